"""Encryption of a push for one browser (RFC 8291, one record of RFC 8188)."""

from __future__ import annotations

import os
import struct

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

MOST_BYTES = 3993  # of a text: push services take 4096 bytes in all
_RECORD = 4096
_LAST = b"\x02"  # mark of the last record


def encrypted_push(text: bytes, browser: bytes, auth: bytes) -> bytes:
    """Encrypt a text for a browser's public key and secret. Raises `ValueError` for a wrong key or a long text."""
    if len(text) > MOST_BYTES:
        raise ValueError(f"A push has at most {MOST_BYTES} bytes.")
    theirs = ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), browser)
    own = ec.generate_private_key(ec.SECP256R1())  # for this push only
    public = point_of(own.public_key())
    info = b"WebPush: info\x00" + browser + public
    shared = _derived(own.exchange(ec.ECDH(), theirs), auth, info, 32)
    salt = os.urandom(16)
    key = _derived(shared, salt, b"Content-Encoding: aes128gcm\x00", 16)
    nonce = _derived(shared, salt, b"Content-Encoding: nonce\x00", 12)
    return (
        salt
        + struct.pack(">IB", _RECORD, len(public))
        + public
        + AESGCM(key).encrypt(nonce, text + _LAST, None)
    )


def point_of(public: ec.EllipticCurvePublicKey) -> bytes:
    """Return a public key as browsers write it."""
    return public.public_bytes(Encoding.X962, PublicFormat.UncompressedPoint)


def _derived(secret: bytes, salt: bytes, info: bytes, length: int) -> bytes:
    return HKDF(SHA256(), length, salt, info).derive(secret)
