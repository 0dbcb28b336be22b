"""Find out whether the processes of `script/serve` are ready, and tell systemd (`Type=notify`)."""

from __future__ import annotations

import http
import http.client
import os
import socket
import ssl
from pathlib import Path

from fleet.base.environment import Environment
from script.stack.places import REPOSITORY

PATIENCE_S = 2.0
ANY = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - an address to listen on -> one to connect to


def answers(address: str, port: int, host: str, *, tls: bool) -> bool:
    """Return whether the web process answers at this address, asked for this host name."""
    address = ANY.get(address, address)
    # With `--behind-proxy` it answers only proxies and this computer's own addresses.
    ours = None if ":" in address else ("127.0.0.1", 0)
    connection = (
        # It is ourselves: whether others trust the certificate is not asked here.
        http.client.HTTPSConnection(
            address, port, timeout=PATIENCE_S, source_address=ours, context=_trusting()
        )
        if tls
        else http.client.HTTPConnection(address, port, timeout=PATIENCE_S, source_address=ours)
    )
    try:
        connection.request("GET", "/livez", headers={"Host": host})
        return connection.getresponse().status == http.HTTPStatus.OK
    except (OSError, http.client.HTTPException):
        return False
    finally:
        connection.close()


def _trusting() -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


def run_directory() -> Path:
    """Return the run directory, as fleet.settings does."""
    env = Environment(os.environ)
    return env.directory("FLEET_RUN_DIR", env.directory("FLEET_VAR", REPOSITORY / "var") / "run")


def tell_systemd(status: str) -> None:
    """Tell systemd that the service is ready; do nothing if it does not ask."""
    if not (address := os.environ.get("NOTIFY_SOCKET")):
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as service_manager:
        service_manager.sendto(f"READY=1\nSTATUS={status}".encode(), address.replace("@", "\0", 1))
