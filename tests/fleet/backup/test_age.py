"""The format of age: what the program `age` encrypted can be read. tests/script/test_backup.py has the other way."""

from __future__ import annotations

import io
import os
from base64 import b64decode

import pytest

from fleet.backup.archive import age
from fleet.backup.errors import Damaged, WrongPassphrase

# By age 1.1.1 with the passphrase "tired".
BY_AGE = b64decode(
    "YWdlLWVuY3J5cHRpb24ub3JnL3YxCi0+IHNjcnlwdCAwWHduc250c0RjL1lCU0NLUWZWaWJ3IDE4Ck5PMjVhaGNyYm1Uc1l6Q1kvVUx3a001bTFX"
    "aVpwS01Md1hJemNtSnpxd2cKLS0tIE5MVmJsZ3pYNW1yOTdlaGxGb0ZBTGIzK2FSeURFejhXWm5mODdXNFRDRWcKiBbO2ksgx6pgMYOyi4W81ZtH"
    "gDeKMKbMb2Gpb2ANnvIxEFDlR2a8UkhddUOvKlcXQAa5m3lFYAWqEpUnpAK29jIVo9mpJ/qfSTmQvdZRDd3DZcJZkebsb+2KwcYGWm7SWu/nkItL"
    "GGZQru7HV+v8shNHlJSRFxAmzCIsjk+pk73+VvX3"
)

PASSPHRASE = "pässphrase"


def encrypted(data: bytes) -> bytes:
    file = io.BytesIO()
    writing = age.Encrypting(file, PASSPHRASE)
    for start in range(0, len(data), 10_000):
        writing.write(data[start : start + 10_000])
    writing.close()
    return file.getvalue()


def decrypted(data: bytes, passphrase: str = PASSPHRASE) -> bytes:
    reading, found = age.Decrypting(io.BytesIO(data), passphrase), b""
    while piece := reading.read(5_000):
        found += piece
    return found


@pytest.fixture(autouse=True)
def cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(age, "WORK", 2)


def test_a_file_of_age_is_read() -> None:
    assert decrypted(BY_AGE, "tired") == b"hello" * 20


@pytest.mark.parametrize("length", [0, 1, age.CHUNK, age.CHUNK + 1, 2 * age.CHUNK])
def test_what_is_written_is_read(length: int) -> None:
    data = os.urandom(length)
    assert decrypted(encrypted(data)) == data


def test_a_wrong_passphrase_and_every_change_are_noticed() -> None:
    whole = encrypted(os.urandom(2 * age.CHUNK))
    with pytest.raises(WrongPassphrase):
        decrypted(whole, "passphrase")
    chunk = age.CHUNK + age.TAG
    changed = [
        whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :] for place in (30, 130, 170, 300, -1)
    ]
    swapped = whole[: -2 * chunk] + whole[-chunk:] + whole[-2 * chunk : -chunk]
    for data in (*changed, swapped, whole[:-chunk], whole[:-1], whole + b"x", whole[:100], b""):
        with pytest.raises((Damaged, WrongPassphrase)):
            decrypted(data)
