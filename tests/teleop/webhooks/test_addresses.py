"""A webhook leads to no private address, however the address is written, unless it is allow-listed."""

from ipaddress import ip_address, ip_network

import pytest
from django.core.exceptions import ImproperlyConfigured

from fleet.base.environment import Environment, WebhookAllow, webhook_allow
from teleop.webhooks.addresses import AddressRefused, is_public, resolved, target_of


@pytest.mark.parametrize(
    "address",
    [
        "127.0.0.1",
        "10.1.2.3",
        "172.16.0.1",
        "192.168.1.20",
        "169.254.169.254",
        "100.64.0.1",
        "0.0.0.0",  # noqa: S104
        "224.0.0.1",
        "240.0.0.1",
        "255.255.255.255",
        "192.0.0.8",
        "198.18.0.1",
        "203.0.113.5",
        "::",
        "::1",
        "fe80::1",
        "fc00::1",
        "fec0::1",
        "ff02::1",
        "2001:db8::1",
        "::127.0.0.1",
        "::ffff:127.0.0.1",
        "::ffff:10.0.0.1",
        "2002:7f00:1::",
        "64:ff9b::10.0.0.1",
        "64:ff9b:1::1",
        "2001::1",
    ],
)
def test_private_and_reserved_addresses_are_not_public(address):
    assert not is_public(ip_address(address))


@pytest.mark.parametrize(
    "address", ["93.184.216.34", "2606:2800:220:1::1", "::ffff:8.8.8.8", "64:ff9b::8.8.8.8"]
)
def test_addresses_of_the_internet_are_public(address):
    assert is_public(ip_address(address))


@pytest.mark.parametrize(
    ("address", "code"),
    [
        ("https://127.0.0.1/", "private_address"),
        ("https://[::1]:8443/x", "private_address"),
        ("https://[::ffff:10.0.0.1]/", "private_address"),
        ("http://93.184.216.34/", "no_tls"),
        ("http://ci.example/", "no_tls"),
        ("ftp://ci.example/", "bad_address"),
        ("https:///x", "bad_address"),
        ("https://me:secret@ci.example/", "bad_address"),
        ("https://good.example\\@127.0.0.1/", "bad_address"),
        ("https://ci.example/#x", "bad_address"),
        ("https://ci.example:0/", "bad_address"),
        ("https://ci.example:99999/", "bad_address"),
        ("https://[::1/", "bad_address"),
        ("https://ci.example/a b", "bad_address"),
        ("https://ci.example/\r\nX: y", "bad_address"),
        ("https://ci.éxample/", "bad_address"),
        ("https://ci.example/" + "x" * 500, "bad_address"),
    ],
)
def test_wrong_addresses_are_refused_at_once(address, code):
    with pytest.raises(AddressRefused) as refused:
        target_of(address)
    assert refused.value.refusal.code == code


@pytest.mark.parametrize("host", ["127.1", "2130706433", "0x7f.1", "localhost"])
def test_other_names_of_this_computer_are_found_by_resolution(host):
    with pytest.raises(AddressRefused) as refused:
        resolved(target_of(f"https://{host}/"))
    assert refused.value.refusal.code == "private_address"


def test_of_several_addresses_only_public_ones_are_used(names):
    names["ci.example"] = ["10.0.0.1", "93.184.216.34"]
    [place] = resolved(target_of("https://ci.example/"))
    assert place.sockaddr == ("93.184.216.34", 443)


@pytest.mark.parametrize("host", ["nowhere.invalid", "a..b", "x" * 70])
def test_a_name_without_address_is_named(host):
    with pytest.raises(AddressRefused, match=host):
        resolved(target_of(f"https://{host}/"))


def test_allow_listed_hosts_may_be_private_and_without_tls(settings, names):
    names |= {"ci.lab.example": ["10.1.0.7"], "other.lab.example": ["10.2.0.7"], "net.example": ["10.9.1.1"]}
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow((ip_network("10.9.0.0/16"),), frozenset({"ci.lab.example"}))
    for host in ("ci.lab.example", "CI.lab.example", "net.example", "[::ffff:10.9.0.1]"):
        assert resolved(target_of(f"http://{host}:8000/"))
    for address in ("https://other.lab.example/", "http://other.lab.example/"):
        with pytest.raises(AddressRefused):
            resolved(target_of(address))


def test_the_allow_list_is_read_from_the_environment():
    def read(text):
        return webhook_allow(Environment({"FLEET_WEBHOOK_ALLOW": text}))

    assert read("") == WebhookAllow()
    found = read("10.1.0.0/16, CI.lab.example,fd00::/8,192.168.1.7")
    assert found.hosts == {"ci.lab.example"}
    assert [str(network) for network in found.networks] == ["10.1.0.0/16", "fd00::/8", "192.168.1.7/32"]
    for wrong in ("10.1.0.0/33", "10.1.0.5/16", "10.1.300.1", "*", "http://ci", "a b"):
        with pytest.raises(ImproperlyConfigured, match="FLEET_WEBHOOK_ALLOW"):
            read(wrong)
