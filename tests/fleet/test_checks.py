"""The system checks report missing packages, static files and TLS, with a remedy."""

from datetime import UTC, datetime

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from fleet.site import checks
from robots.link import authority


def test_missing_npm_packages_are_named_with_the_command(settings, tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    settings.NPM_DISTRIBUTIONS = [("vendor/there", there), ("vendor/uplot", tmp_path / "uplot/dist")]
    (warning,) = checks.npm_packages_installed()
    assert "vendor/uplot" in warning.msg
    assert "script/setup web" in warning.hint


def test_uncollected_static_files_are_noticed_in_production_only(settings, tmp_path):
    settings.STATIC_ROOT = tmp_path
    (warning,) = checks.static_files_collected()
    assert "collectstatic" in warning.hint
    settings.DEBUG = True
    assert checks.static_files_collected() == []


def test_collected_static_files_are_enough(settings, tmp_path):
    settings.STATIC_ROOT = tmp_path
    (tmp_path / "staticfiles.json").write_text("{}")
    assert checks.static_files_collected() == []


def test_plain_http_is_warned_of_in_production_only(settings):
    (warning,) = checks.tls_is_on()
    assert "FLEET_TLS is off" in warning.msg
    settings.FLEET_TLS = True
    assert checks.tls_is_on() == []
    settings.FLEET_TLS, settings.DEBUG = False, True
    assert checks.tls_is_on() == []


def test_a_sender_that_is_no_address_is_warned_of(settings):
    assert checks.e_mails_have_a_sender() == []
    settings.DEFAULT_FROM_EMAIL = "Robots, Lab <robots@lab.example>"
    (warning,) = checks.e_mails_have_a_sender()
    assert warning.msg.startswith("FLEET_EMAIL_FROM is 'Robots, Lab <robots@lab.example>'")


def test_a_bridge_host_without_the_consoles_authority_is_warned_of(settings, tmp_path):
    key = ec.generate_private_key(ec.SECP256R1())
    request = x509.CertificateSigningRequestBuilder().subject_name(x509.Name([])).sign(key, hashes.SHA256())
    pem = request.public_bytes(serialization.Encoding.PEM)
    settings.FLEET_LINK_CERT = str(tmp_path / "fleet.crt")
    (tmp_path / "fleet.crt").write_text(authority.sign(pem, "arm.lab.example", datetime.now(UTC))[0])
    assert checks.other_bridges_are_trusted() == []
    settings.SECRET_KEY = "that of a bridge host, which is its own"
    (warning,) = checks.other_bridges_are_trusted()
    assert "stop --all" in warning.msg
    settings.FLEET_LINK_CA = str(tmp_path / "fleet-authority.crt")
    assert checks.other_bridges_are_trusted() == []
