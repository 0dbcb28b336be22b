"""The shipped files for nginx and Caddy: secrets of links are in no log, also when the console does not answer."""

from __future__ import annotations

import http.client
import shutil
import ssl
from collections.abc import Sequence
from pathlib import Path

import pytest

from script.stack.certificates import certificate_for
from script.stack.places import REPOSITORY
from script.stack.processes import Child, end_all
from script.stack.stack import Certificate
from tests.processes import free_port, outside, until
from tests.script.computers import listens

SECRET = "4sX9kq7-Zt_2vB8nQw"


@pytest.fixture
def certificate(tmp_path: Path) -> Certificate:
    return certificate_for(["localhost"], tmp_path / "tls")


def shipped(name: str, changes: dict[str, str]) -> str:
    text = (REPOSITORY / "deploy" / name).read_text()
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after)
    return text


def asked_in_vain(command: Sequence[str | Path], port: int, certificate: Certificate, folder: Path) -> str:
    """Ask the proxy for a link with a secret; return its log."""
    home = {name: str(folder) for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "HOME")}
    proxy = Child("proxy", [str(word) for word in command], env=outside() | home, log=folder / "log")
    try:
        until(lambda: listens(port) or not proxy.running, "the proxy listens", 20.0)
        trusting = ssl.create_default_context(cafile=certificate.authority)
        connection = http.client.HTTPSConnection("localhost", port, context=trusting, timeout=20.0)
        connection.request(
            "GET", f"/join/{SECRET}/", headers={"Referer": f"https://localhost/join/{SECRET}/"}
        )
        assert connection.getresponse().status == 502
        connection.close()
    finally:
        end_all([proxy])
    return "".join(path.read_text() for path in folder.glob("*log"))


@pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here")
def test_nginx_logs_no_secret(tmp_path: Path, certificate: Certificate) -> None:
    port = free_port()
    listening = {"listen 443 ": f"listen {port} ", "listen [::]:443 ": f"listen [::]:{port} "}
    unused = {"listen 80;": f"listen 127.0.0.1:{free_port()};", "listen [::]:80;": ""}
    files = {
        "/etc/ssl/fleet.crt": str(certificate.certificate),
        "/etc/ssl/private/fleet.key": str(certificate.private_key),
        "/var/log/nginx/": f"{tmp_path}/",
        "fleet.lab.example": "localhost",
        "127.0.0.1:8000": f"127.0.0.1:{free_port()}",
    }
    (tmp_path / "fleet.conf").write_text(shipped("nginx.conf", listening | unused | files))
    temporary = "".join(
        f"{kind}_temp_path {tmp_path}/{kind};"
        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (tmp_path / "nginx.conf").write_text(
        f"daemon off; pid {tmp_path}/pid; error_log stderr; events {{}}\n"
        f"http {{ {temporary} include {tmp_path}/fleet.conf; }}\n"
    )
    command = ["nginx", "-p", tmp_path, "-c", tmp_path / "nginx.conf"]
    assert SECRET not in asked_in_vain(command, port, certificate, tmp_path)


@pytest.mark.skipif(shutil.which("caddy") is None, reason="no Caddy here")
def test_caddy_logs_errors_without_their_requests(tmp_path: Path, certificate: Certificate) -> None:
    port = free_port()
    site = f"https://localhost:{port} {{\n\ttls {certificate.certificate} {certificate.private_key}"
    (tmp_path / "Caddyfile").write_text(
        shipped(
            "Caddyfile",
            {
                "\n{\n": "\n{\n\tadmin off\n\tauto_https disable_redirects\n",
                "fleet.lab.example {": site,
                "127.0.0.1:8000": f"127.0.0.1:{free_port()}",
            },
        )
    )
    command = ["caddy", "run", "--config", tmp_path / "Caddyfile", "--adapter", "caddyfile"]
    log = asked_in_vain(command, port, certificate, tmp_path)
    assert "connection refused" in log
    assert SECRET not in log
