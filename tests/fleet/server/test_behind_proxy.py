"""`script/serve --behind-proxy`: a TLS proxy in front of the real web process."""

import http.client
import json
import re
import socket
import time
from http.cookies import SimpleCookie
from ipaddress import ip_network
from types import SimpleNamespace

import pytest

from fleet.server.front import Front
from script.stack.processes import Child, end_all
from script.stack.serve import THIS_MACHINE, arguments, setup_address, web_command
from tests.conftest import PASSWORD
from tests.fleet.support import console_environment, create_database

HOST = "fleet.example"
PROXY = "127.0.0.5"  # Linux answers on all of 127.0.0.0/8
PAGE = "/accounts/sign-in/"
FROM_THE_PROXY = {"Host": HOST, "X-Forwarded-Proto": "https", "X-Forwarded-For": "10.0.0.7"}


@pytest.fixture(scope="module")
def port(tmp_path_factory):
    """Port of a web process with one account, "first"."""
    folder = tmp_path_factory.mktemp("behind-proxy")
    environ = console_environment(folder, HOST, FLEET_TLS="1")
    create_database(environ)
    with socket.create_server(("127.0.0.1", 0)) as free:
        number = free.getsockname()[1]
    command = web_command(arguments(["--behind-proxy", PROXY, "--port", str(number)]))
    command[command.index("--proxies") + 1] = PROXY  # and this test is not the proxy of this machine
    web = Child("web", command, env=environ, log=folder / "web.log")
    try:
        _wait_until_it_listens(number, web)
        yield number
    finally:
        end_all([web])


def _wait_until_it_listens(port, web):
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and web.running:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return
        except ConnectionRefusedError:
            time.sleep(0.05)
    pytest.fail(f"no web process: {web.last_lines()}")


def _ask(port, method, path, body=None, client=PROXY, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30, source_address=(client, 0))
    try:
        connection.request(method, path, body, FROM_THE_PROXY | headers)
        response = connection.getresponse()
        cookies = SimpleCookie()
        for line in response.headers.get_all("Set-Cookie", []):
            cookies.load(line)
        return (
            response.status,
            response.read().decode(),
            {name: morsel.value for name, morsel in cookies.items()},
        )
    finally:
        connection.close()


def test_people_behind_a_proxy_are_listed_by_their_address(port):
    _status, page, cookies = _ask(port, "GET", PAGE)
    token = re.search(r'name="csrfmiddlewaretoken" value="(\w+)"', page)[1]
    form = f"csrfmiddlewaretoken={token}&username=first&password={PASSWORD.replace(' ', '+')}"
    sent = {"Content-Type": "application/x-www-form-urlencoded", "Origin": f"https://{HOST}"}
    status, _page, given = _ask(port, "POST", PAGE, form, Cookie=_cookie(cookies), **sent)
    assert status == 302
    assert "10.0.0.7" in _ask(port, "GET", "/accounts/sessions/", Cookie=_cookie(given))[1]


def test_nobody_passes_the_proxy(port):
    status, text, _cookies = _ask(port, "GET", PAGE, client="127.0.0.1")
    assert (status, json.loads(text)["code"]) == (403, "not_a_proxy")


def _cookie(cookies):
    return "; ".join(f"{name}={value}" for name, value in cookies.items())


@pytest.mark.parametrize(
    "words",
    [
        ["--bind", "10.0.0.7"],
        ["--bind", "192.168.1.20"],
        ["--certificate", "a.crt", "--private-key", "a.key"],
    ],
)
def test_without_addresses_the_proxy_is_on_this_machine(words):
    with pytest.raises(SystemExit):
        arguments(["--behind-proxy", *words])


def test_proxies_are_addresses_and_networks():
    asked = arguments(["--behind-proxy", "10.0.0.5,10.1.0.0/16", "--bind", "10.0.0.2"])
    assert "10.0.0.5/32,10.1.0.0/16,127.0.0.0/8,::1" in web_command(asked)
    for none in ("proxy.example", "0.0.0.0/0", "10.0.0.5,::/0"):
        with pytest.raises(SystemExit):
            arguments(["--behind-proxy", none, "--bind", "10.0.0.2"])


@pytest.mark.parametrize(
    ("peer", "is_served"),
    [("10.0.0.5", True), ("::ffff:10.0.0.5", True), ("127.0.0.1", True), ("10.0.0.7", False), (None, True)],
)
def test_only_a_named_proxy_is_served(peer, is_served):
    proxies = [ip_network(one) for one in ("10.0.0.5/32", THIS_MACHINE.split(",")[0])]
    front = Front(None, session_cookie="sessionid", behind_proxy=True, proxies=proxies)
    transport = SimpleNamespace(getPeer=lambda: SimpleNamespace(host=peer))
    assert front.serves(transport) is is_served


def test_without_it_no_header_is_believed():
    assert "--proxy-headers" not in web_command(arguments([]))


@pytest.mark.parametrize(
    ("words", "address"),
    [
        (["--behind-proxy"], "https://fleet.example/setup/"),
        (["--behind-proxy", PROXY, "--bind", "10.0.0.2"], "https://fleet.example/setup/"),
        (["--port", "8001"], "http://localhost:8001/setup/"),
    ],
)
def test_the_first_page_is_where_its_reader_is(words, address, monkeypatch):
    """A new /etc/fleet.env names localhost first; a proxy's certificate does not."""
    monkeypatch.setenv("FLEET_HOSTS", f"localhost,{HOST}")
    assert setup_address(arguments(words)) == address
