"""The console's key for push services (RFC 8292): they take a push to a browser only from who signs with it.

All processes share it, so it is in the database, encrypted with a key from FLEET_SECRET_KEY. If that setting
changed, the key cannot be read: a new one is made, and devices must be added again, because they know the old one.
"""

from __future__ import annotations

import logging
import time
from base64 import urlsafe_b64decode, urlsafe_b64encode
from email.utils import parseaddr
from typing import cast

import jwt
from cryptography.fernet import InvalidToken
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from django.conf import settings
from django.db import transaction

from fleet.accounts.sign_in.secrets import decrypted, encrypted
from teleop.models import PushKey, PushSubscription
from teleop.push.encryption import point_of

log = logging.getLogger(__name__)

VALID_S = 12 * 60 * 60


def public_key() -> str:
    """Return the console's public key, as browsers take it."""
    return b64(point_of(_own_key().public_key()))


def signature_for(origin: str) -> str:
    """Return the header Authorization for the push service at this origin."""
    key = _own_key()
    _name, sender = parseaddr(settings.DEFAULT_FROM_EMAIL)
    claims = {"aud": origin, "exp": int(time.time()) + VALID_S, "sub": f"mailto:{sender}"}
    token = jwt.encode(claims, key, algorithm="ES256")
    return f"vapid t={token}, k={b64(point_of(key.public_key()))}"


def b64(raw: bytes) -> str:
    """Return bytes as browsers write them."""
    return urlsafe_b64encode(raw).decode().rstrip("=")


def from_b64(text: str) -> bytes:
    """Return the bytes that a browser wrote. Raises `ValueError`."""
    return urlsafe_b64decode(text + "=" * (-len(text) % 4))


def _own_key() -> ec.EllipticCurvePrivateKey:
    """Return the console's key; make it if there is none, or none that can be read."""
    stored = PushKey.objects.filter(pk=1).first()
    if stored is None:
        stored, _new = PushKey.objects.get_or_create(pk=1, defaults={"private": _new_key()})
    try:
        return _read(stored.private)
    except InvalidToken:
        log.warning(
            "The key for push services cannot be read: FLEET_SECRET_KEY changed. Devices are removed."
        )
    with transaction.atomic():
        locked = PushKey.objects.select_for_update().get(pk=1)
        if locked.private == stored.private:  # else another process has made a new one meanwhile
            PushSubscription.objects.all().delete()
            locked.private = _new_key()
            locked.save()
    return _read(locked.private)


def _new_key() -> str:
    key = ec.generate_private_key(ec.SECP256R1())
    return encrypted(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode())


def _read(private: str) -> ec.EllipticCurvePrivateKey:
    return cast(ec.EllipticCurvePrivateKey, load_pem_private_key(decrypted(private).encode(), None))
