"""Encryption of secrets in the database with a key from FLEET_SECRET_KEY."""

from __future__ import annotations

import base64
import hashlib

from cryptography.fernet import Fernet
from django.conf import settings


def encrypted(text: str) -> str:
    return _fernet().encrypt(text.encode()).decode()


def decrypted(token: str) -> str:
    """Decrypt a text. Raises `cryptography.fernet.InvalidToken` if it was encrypted with another key."""
    return _fernet().decrypt(token.encode()).decode()


def _fernet() -> Fernet:
    key = hashlib.sha256(b"fleet.accounts.second_factor" + settings.SECRET_KEY.encode()).digest()
    return Fernet(base64.urlsafe_b64encode(key))
