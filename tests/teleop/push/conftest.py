"""A push service in this process, and a browser that subscribed to it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from ipaddress import ip_network
from typing import Any

import http_ece
import pytest
from cryptography.hazmat.primitives.asymmetric import ec

from fleet.base.environment import WebhookAllow
from teleop.push.encryption import point_of
from teleop.push.keys import b64
from tests.processes import serving
from tests.teleop.webhooks.conftest import Receiver


class Browser:
    """The keys that a browser keeps for itself, and those that it gives to the console."""

    def __init__(self, endpoint: str) -> None:
        self._private = ec.generate_private_key(ec.SECP256R1())
        self._auth = os.urandom(16)
        self.endpoint = endpoint
        self.keys = {"p256dh": b64(point_of(self._private.public_key())), "auth": b64(self._auth)}

    @property
    def subscription(self) -> dict[str, Any]:
        return {"endpoint": self.endpoint, "expirationTime": None, "keys": self.keys}

    def reads(self, body: bytes) -> dict[str, str]:
        """Decrypt a push, by another implementation than the console's."""
        text = http_ece.decrypt(body, private_key=self._private, auth_secret=self._auth, version="aes128gcm")
        found: dict[str, str] = json.loads(text)
        return found


@pytest.fixture
def service(settings: Any) -> Iterator[Receiver]:
    """A push service at this computer, which the console may reach."""
    settings.FLEET_PUSH_ALLOW = WebhookAllow((ip_network("127.0.0.0/8"),))
    server = Receiver()
    with serving(server):
        yield server


@pytest.fixture
def browser(service: Receiver) -> Browser:
    return Browser(f"http://127.0.0.1:{service.server_port}/push/1")
