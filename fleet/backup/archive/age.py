"""Files encrypted by a passphrase in the format of age (https://age-encryption.org/v1), which `age --decrypt` opens.

In chunks: a file may be larger than the memory. A file that was changed or cut off is refused.
"""

from __future__ import annotations

import os
import re
from base64 import b64decode, b64encode
from io import BytesIO
from typing import BinaryIO

from cryptography.exceptions import InvalidSignature, InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.hmac import HMAC
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

from fleet.backup.errors import Damaged, WrongPassphrase

MAGIC = b"age-encryption.org/v1\n"
WORK = 17  # log2 of scrypt's cost: 128 MB of memory for half a second
MOST_WORK = 22
CHUNK = 64 * 1024
TAG = 16
_HEADER = re.compile(
    rb"(?P<signed>age-encryption\.org/v1\n-> scrypt (?P<salt>[\w+/]{22}) (?P<work>[1-9]\d?)\n(?P<key>[\w+/]{43})\n---)"
    rb" (?P<mac>[\w+/]{43})\n",
    re.ASCII,
)
_HEADER_BYTES = 200  # at most


class Encrypting:
    """Writes a file: `close` ends it. Without it, the file counts as cut off."""

    def __init__(self, file: BinaryIO, passphrase: str) -> None:
        key, salt, nonce = os.urandom(16), os.urandom(16), os.urandom(16)
        wrapped = ChaCha20Poly1305(_wrapping_key(passphrase, salt, WORK)).encrypt(bytes(12), key, None)
        signed = MAGIC + b"-> scrypt %s %d\n%s\n---" % (_text(salt), WORK, _text(wrapped))
        file.write(signed + b" " + _text(_mac(key, signed).finalize()) + b"\n" + nonce)
        self._file, self._chunks, self._kept = file, _Chunks(key, nonce), bytearray()

    def write(self, data: bytes) -> int:
        """Write these bytes, or keep them until the chunk is full: only `close` knows the last one."""
        self._kept += data
        while len(self._kept) > CHUNK:
            self._file.write(self._chunks.encrypted(bytes(self._kept[:CHUNK]), last=False))
            del self._kept[:CHUNK]
        return len(data)

    def flush(self) -> None:
        """Do nothing: chunks are written when they are full."""

    def close(self) -> None:
        """Write the last chunk. The file itself stays open."""
        self._file.write(self._chunks.encrypted(bytes(self._kept), last=True))


class Decrypting:
    """Reads such a file. Raises `WrongPassphrase` or `Damaged`."""

    def __init__(self, file: BinaryIO, passphrase: str) -> None:
        begin = file.read(_HEADER_BYTES)
        header = _HEADER.match(begin)
        if header is None or int(header["work"]) > MOST_WORK:
            raise Damaged("it is not encrypted by a passphrase of age")
        wrapping = _wrapping_key(passphrase, _bytes(header["salt"]), int(header["work"]))
        try:
            key = ChaCha20Poly1305(wrapping).decrypt(bytes(12), _bytes(header["key"]), None)
        except InvalidTag as error:
            raise WrongPassphrase from error
        try:
            _mac(key, header["signed"]).verify(_bytes(header["mac"]))
        except InvalidSignature as error:
            raise Damaged("its header was changed") from error
        file.seek(header.end())
        self._file, self._chunks = file, _Chunks(key, file.read(16))
        self._ahead = file.read(CHUNK + TAG)
        self._clear = BytesIO()

    def read(self, size: int) -> bytes:
        """Return the next bytes, at most `size`; none at the end."""
        read = self._clear.read(size)
        if read or not self._ahead:
            return read
        chunk, self._ahead = self._ahead, self._file.read(CHUNK + TAG)
        self._clear = BytesIO(self._chunks.decrypted(chunk, last=not self._ahead))
        return self._clear.read(size)


class _Chunks:
    """The chunks of a file, each with its number."""

    def __init__(self, key: bytes, nonce: bytes) -> None:
        self._cipher = ChaCha20Poly1305(HKDF(SHA256(), 32, nonce, b"payload").derive(key))
        self._number = 0

    def encrypted(self, data: bytes, *, last: bool) -> bytes:
        return self._cipher.encrypt(self._nonce(last), data, None)

    def decrypted(self, data: bytes, *, last: bool) -> bytes:
        try:
            return self._cipher.decrypt(self._nonce(last), data, None)
        except InvalidTag as error:
            raise Damaged("it is cut off or was changed") from error

    def _nonce(self, last: bool) -> bytes:
        self._number += 1
        return (self._number - 1).to_bytes(11) + bytes([last])


def _wrapping_key(passphrase: str, salt: bytes, work: int) -> bytes:
    salted = MAGIC.strip() + b"/scrypt" + salt
    return Scrypt(salted, length=32, n=1 << work, r=8, p=1).derive(passphrase.encode())


def _mac(key: bytes, signed: bytes) -> HMAC:
    mac = HMAC(HKDF(SHA256(), 32, None, b"header").derive(key), SHA256())
    mac.update(signed)
    return mac


def _text(data: bytes) -> bytes:
    return b64encode(data).rstrip(b"=")


def _bytes(text: bytes) -> bytes:
    return b64decode(text + b"=" * (-len(text) % 4))
