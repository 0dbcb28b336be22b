"""A build of Lichtblick at /lichtblick/: its files and no others, under a policy of its own."""

import base64
import hashlib

import pytest
from django.test import Client

from teleop.foxglove.lichtblick import AT, Build

pytestmark = pytest.mark.django_db

START = "globalThis.LICHTBLICK_SUITE_DEFAULT_LAYOUT = [][0];"
PAGE = f'<!doctype html><script src="main.0123456789abcdef.js"></script><script>{START}</script>'


@pytest.fixture
def build(tmp_path, settings):
    """A build with the kinds of files that a real one has, beside a file that is none of its own."""
    folder = tmp_path / "web"
    (folder / "deep").mkdir(parents=True)
    (folder / "index.html").write_text(PAGE)
    (folder / "main.0123456789abcdef.js").write_text("run()")
    (folder / "0123456789abcdef0123.wasm").write_bytes(b"\0asm")
    (folder / "deep/favicon.png").write_bytes(b"\x89PNG")
    (tmp_path / "secret.txt").write_text("secret")
    (folder / "link.txt").symlink_to(tmp_path / "secret.txt")
    settings.FLEET_LICHTBLICK = folder
    return folder


@pytest.fixture
def client(staff, signed_in):
    """A signed-in browser."""
    return signed_in(staff)


@pytest.mark.parametrize(
    ("name", "kind", "kept"),
    [
        ("", "text/html", "max-age=0, public"),
        ("main.0123456789abcdef.js", "text/javascript", "immutable"),
        ("0123456789abcdef0123.wasm", "application/wasm", "immutable"),
        ("deep/favicon.png", "image/png", "max-age=0, public"),
    ],
)
def test_each_file_has_its_type_and_time(name, kind, kept, build, client):
    response = client.get(AT + name)
    assert b"".join(response) == (build / (name or "index.html")).read_bytes()
    assert response["Content-Type"].partition(";")[0] == kind
    assert kept in response["Cache-Control"]
    assert response["X-Content-Type-Options"] == "nosniff"


def test_address_without_slash_leads_to_the_page(build, client):
    response = client.get(AT.rstrip("/"), {"ds": "foxglove-websocket"})
    assert response.status_code == 301
    assert response["Location"] == "/lichtblick/?ds=foxglove-websocket"


@pytest.mark.parametrize(
    "path",
    [
        *("../secret.txt", "%2e%2e/secret.txt", "deep/../../secret.txt", "..%2fsecret.txt", "//etc/passwd"),
        *("link.txt", "deep/", "nothing.js", "..\\secret.txt", "index.html%00.js"),
    ],
)
def test_no_other_file_is_sent(path, build, client):
    assert client.get(AT + path).status_code == 404


def test_without_a_build_there_is_no_page(client, settings):
    settings.FLEET_LICHTBLICK = None
    assert client.get(AT).status_code == 404


def test_strangers_get_nothing(build):
    assert Client().get(AT).status_code in (302, 401)


@pytest.mark.parametrize(("tls", "http", "ws"), [(False, "http", "ws"), (True, "https", "wss")])
def test_policy_lets_it_reach_its_files_and_the_door_alone(tls, http, ws, build, client, settings):
    settings.FLEET_TLS = tls
    for name in ("", "main.0123456789abcdef.js"):
        policy = dict(
            one.split(" ", 1) for one in client.head(AT + name)["Content-Security-Policy"].split("; ")
        )
        files = f"{http}://testserver/lichtblick/"
        assert policy["default-src"] == policy["form-action"] == policy["frame-ancestors"] == "'none'"
        assert policy["connect-src"] == f"{files} {ws}://testserver/foxglove/ data: blob:"
        assert "allow-popups" not in policy["sandbox"]
        digest = base64.b64encode(hashlib.sha256(START.encode()).digest()).decode()
        assert policy["script-src"] == f"{files} blob: 'unsafe-eval' 'sha256-{digest}'"
        assert "'self'" not in " ".join(policy.values())


def test_a_new_build_takes_effect_with_the_next_start(build):
    (build / "main.fedcba9876543210.js").write_text("")
    assert AT + "main.fedcba9876543210.js" in Build(build).files
