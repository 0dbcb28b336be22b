"""Other computers that run bridges: the code with which one joins, and the settings that it gets for it."""

from __future__ import annotations

import hashlib
import ipaddress
import os
import secrets
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.utils import timezone
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit.services import record
from robots.link import authority
from robots.registry.models import BridgeHost, Robot
from robots.registry.models.bridges import FIRST_PORT

CODE_LASTS = timedelta(minutes=30)  # the other computer may install packages first


class NotJoined(Exception):
    """The code is unknown, used or too old, or what came with it is no request for a certificate."""


class NotNow(Exception):
    """The code is right, but no other computer can run bridges now; the text says why."""


class Joined(Struct, frozen=True):
    """Files of a computer for its code: settings, its certificate, the authority of all bridges' certificates."""

    settings: dict[str, str]
    certificate: str
    authority: str


def why_not() -> Promise | str:
    """Return why no other computer can run bridges now; "" if it can."""
    database = settings.DATABASES["default"]
    if not database["ENGINE"].endswith("postgresql"):
        return _(
            "The database is SQLite, a file on this computer: use PostgreSQL (FLEET_DATABASE_URL) first."
        )
    if _is_near(database.get("HOST") or database["OPTIONS"].get("host") or ""):
        return _(
            "FLEET_DATABASE_URL names a database on this computer: give PostgreSQL an address that the other computer "
            "reaches, and name it there."
        )
    if not settings.FLEET_LINK_SECRET:
        return _(
            "FLEET_LINK_SECRET is not set: set 32 random characters or more, and restart the console's processes."
        )
    if settings.FLEET_LINK_CA:
        return _(
            "FLEET_LINK_CA is set: certificates come from your own authority, and settings are made by hand."
        )
    if not settings.FLEET_TLS:
        return _("FLEET_TLS is off: secrets are handed on over TLS only.")
    return ""


def _is_near(host: str) -> bool:
    """Return whether only this computer reaches a database at this host."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return not host or host.startswith("/") or host == "localhost"


def code_make(host: BridgeHost, actor: User) -> str:
    """Save the host with a new code, and return the code. Earlier codes of the host end."""
    code = secrets.token_hex(20)  # a word of a command: it must not begin with -
    host.code_digest, host.code_until = _digest(code), timezone.now() + CODE_LASTS
    with transaction.atomic():
        host.save()
        record("host.code", actor=actor, parameters={"host": host.name})
    return code


def join(code: str, certificate_request: str, address: str) -> Joined:
    """End the code, and return the settings of its host with a certificate. Raises `NotJoined` or `NotNow`."""
    now = timezone.now()
    with transaction.atomic():
        host = BridgeHost.objects.select_for_update().filter(code_digest=_digest(code)).first()
        if host is None or host.code_until is None or not now < host.code_until:
            raise NotJoined
        if reason := why_not():
            raise NotNow(reason)
        try:
            certificate, until = authority.sign(certificate_request.encode(), host.name, now)
        except ValueError as error:
            raise NotJoined from error
        _joined(host, now, until)
        record("host.join", parameters={"host": host.name}, private={"address": address})
    return Joined(
        {
            "FLEET_BRIDGE_HOST": host.name,
            "FLEET_DATABASE_URL": os.environ["FLEET_DATABASE_URL"],
            "FLEET_LINK_SECRET": str(settings.FLEET_LINK_SECRET),
        },
        certificate,
        authority.authority_pem(),
    )


def _joined(host: BridgeHost, now: datetime, until: datetime) -> None:
    host.code_digest, host.code_until = "", None
    host.joined_at, host.certificate_until = now, until
    host.save()


def remove(host: BridgeHost, actor: User) -> None:
    """Take the host from the list, and end its code. A computer that has joined keeps its settings and certificate."""
    with transaction.atomic():
        record("host.remove", actor=actor, parameters={"host": host.name})
        host.delete()


def free_addresses() -> list[str]:
    """Return the next free bridge address of each host that has joined."""
    taken = set(Robot.objects.exclude(bridge_address="").values_list("bridge_address", flat=True))
    return [
        next(one for port in range(FIRST_PORT, 65536) if (one := f"wss://{name}:{port}") not in taken)
        for name in BridgeHost.objects.exclude(joined_at=None).values_list("name", flat=True)
    ]


def _digest(code: str) -> str:
    return hashlib.sha256(code.encode()).hexdigest()
