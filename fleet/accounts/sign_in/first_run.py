"""The one-time code of a new installation, with which the first admin makes their account.

The code is made while there is no account (`manage.py setup_code`, which script/serve runs), printed once, and kept
as a digest in FLEET_VAR. It ends with its use, with the first account, and with the next code.
"""

from __future__ import annotations

import hashlib
import os
import secrets
from pathlib import Path

from django.conf import settings
from django.db import transaction
from django.http import HttpRequest
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.accounts.services import address_of
from fleet.accounts.sign_in import throttle
from fleet.audit.services import record

ALPHABET = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"  # without characters that look alike: 5 bits each
GROUPS, GROUP = 3, 4
NAME = "set-up code"  # the name under which wrong codes are counted, like wrong passwords of a user name


def code_make() -> str | None:
    """Return a new code, such as "ABCD-EFGH-JKLM".

    If somebody has an account, delete the old code and return None.
    """
    if User.objects.exists():
        _file().unlink(missing_ok=True)
        return None
    groups = ("".join(secrets.choice(ALPHABET) for _letter in range(GROUP)) for _group in range(GROUPS))
    code = "-".join(groups)
    with os.fdopen(os.open(_file(), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
        file.write(_digest(code))
    return code


def is_waiting() -> bool:
    """Return whether the console waits for its first account.

    Once it is set up, this only checks for a file.
    """
    if not _file().exists():
        return False
    if User.objects.exists():  # somebody made it at a terminal
        _file().unlink(missing_ok=True)
        return False
    return True


def admin_make(request: HttpRequest, user: User, code: str) -> str:
    """Save `user`, whose password is set, as the first admin. Return "", or the reason why it was not done.

    Reasons: the code is wrong, or somebody else was faster. Raises `throttle.TooMany` after many wrong codes.
    """
    address = address_of(request)
    with throttle.attempt(username=NAME, address=address):
        if not _is_right(code):
            throttle.failure_recorded(username=NAME, address=address)
            return _("This is not the code that script/serve printed last.")
    claimed = _file().with_suffix(".used")
    try:
        _file().rename(claimed)  # if two people do this at once, only one succeeds
    except FileNotFoundError:
        return _("Somebody else has just set this console up. Sign in.")
    try:
        with transaction.atomic():
            user.is_staff = user.is_superuser = True
            user.save()
            record("setup.admin", actor=user, private={"address": address})
    except BaseException:
        claimed.rename(_file())
        raise
    claimed.unlink()
    return ""


def _is_right(code: str) -> bool:
    try:
        digest = _file().read_text()
    except FileNotFoundError:
        return False
    return secrets.compare_digest(_digest(code), digest)


def _digest(code: str) -> str:
    plain = "".join(letter for letter in code.upper() if letter in ALPHABET)
    return hashlib.sha256(plain.encode()).hexdigest()


def _file() -> Path:
    return Path(settings.FLEET_VAR) / "setup-code"
