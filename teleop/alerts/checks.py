"""Finds the troubles that need somebody now. Each check looks at real parts, and returns its troubles."""

from __future__ import annotations

import shutil
import socket
import ssl
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from cryptography import x509
from django.conf import settings
from django.db import connection
from django.db.models import Min
from django.utils import timezone
from redis import Redis, RedisError

from fleet.accounts import emails
from fleet.accounts.mail.off import is_off
from fleet.backup.selectors import last_backup
from fleet.base.web.origin import settled_origin
from fleet.bookings.messages.notifications import unsent_since
from robots.link.connections import LinkRefused
from robots.link.state_reader import AT_ONCE, state_once
from robots.recordings.models import Place, Recording
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.processes.one_supervisor import FROZEN_S, LOCK, beat_age_s, forgotten, supervised
from robots.shared.sentences import Sentence, say

DISK_SHARE, DISK_BYTES = 0.05, 1e9  # less free space than both of them is a trouble
BACKUP_AGE = timedelta(days=2)
MAIL_AGE = timedelta(minutes=30)
STORE_AGE = timedelta(hours=2)
STORE_LEFT = timedelta(days=7)  # older ones are on computers that are gone
CERTIFICATE_LEFT = timedelta(days=21)
CONNECT_S = 3.0
CERTIFICATES_S = 3600.0  # between two looks


Times = tuple[datetime, datetime]  # begin and end


class Trouble(NamedTuple):
    """Something that needs somebody. `subject`: which one of its kind, such as a robot's slug; may be empty."""

    kind: str
    subject: str
    words: Sentence
    robot: Robot | None = None


def robots() -> Iterator[Trouble]:
    """Ask each robot's bridge how the robot is."""
    found = list(Robot.objects.filter(enabled=True).select_related("profile"))
    asked = [(robot, link_address(robot)) for robot in found]
    with ThreadPoolExecutor(max_workers=AT_ONCE) as pool:
        yield from (one for one in pool.map(lambda pair: _of_robot(*pair), asked) if one is not None)


def _of_robot(robot: Robot, address: LinkAddress) -> Trouble | None:
    try:
        state = state_once(robot.id, address)
    except LinkRefused as refused:
        words = say(
            "{robot}: its bridge does not answer: {why}", robot=robot.name, why=refused.refusal.sentence
        )
        return Trouble("bridge", robot.slug, words, robot)
    if state.phase != "online":
        words = say("{robot} does not answer: {why}", robot=robot.name, why=state.sentence)
        return Trouble("robot", robot.slug, words, robot)
    if state.watchdog_missing:
        words = say("{robot}: its watchdog is missing: only the bridge can stop it.", robot=robot.name)
        return Trouble("watchdog", robot.slug, words, robot)
    return None


def supervisor() -> Iterator[Trouble]:
    """Look whether the fleet supervisor of this computer runs and steps. A web computer has none."""
    lock: Path = settings.FLEET_RUN_DIR / LOCK
    if forgotten(lock):
        return
    if not supervised(lock):
        words = say("The fleet supervisor has ended: no bridge is started again.")
    elif (age_s := beat_age_s(lock)) > FROZEN_S:
        words = say("The fleet supervisor has been frozen for {age:age}.", age=age_s)
    else:
        return
    yield Trouble("supervisor", socket.gethostname()[:64], words)


def redis() -> Iterator[Trouble]:
    """Ask Redis, if the console has one."""
    for url in settings.CHANNEL_LAYERS["default"].get("CONFIG", {}).get("hosts", ()):
        try:
            with Redis.from_url(url, socket_timeout=CONNECT_S, socket_connect_timeout=CONNECT_S) as client:
                client.ping()
        except (RedisError, OSError):
            yield Trouble(
                "redis", "", say("Redis does not answer: news reach other pages two seconds later.")
            )


def mail() -> Iterator[Trouble]:
    """Look for e-mails that the mail server does not take."""
    if is_off():
        return
    if why := emails.why_none_leaves():
        computer = socket.gethostname()[:64]
        words = say(
            "The mail server takes no e-mail from {computer}: {why}", computer=computer, why=why[:300]
        )
        yield Trouble("mail", computer, words)
    since = unsent_since(timezone.now())
    if since is not None and (age := timezone.now() - since) > MAIL_AGE:
        words = say(
            "E-mails about bookings have waited for {age:age}: the console’s log says why.",
            age=age.total_seconds(),
        )
        yield Trouble("mail", "", words)


def database() -> Iterator[Trouble]:
    """Ask the database. Raises DatabaseError: its trouble cannot be stored."""
    with connection.cursor() as cursor:
        cursor.execute("SELECT 1")
    yield from ()


def disk() -> Iterator[Trouble]:
    """Look for free space where the console writes."""
    usage = shutil.disk_usage(settings.FLEET_VAR)
    if usage.free < min(DISK_BYTES, DISK_SHARE * usage.total):
        words = say(
            "The disk of {computer} is nearly full: {free:.1f} GB are left.",
            computer=socket.gethostname()[:64],
            free=usage.free / 1e9,
        )
        yield Trouble("disk", socket.gethostname()[:64], words)


def backup() -> Iterator[Trouble]:
    """Look for a recent backup."""
    last = last_backup()
    if last.at is None:
        yield Trouble("backup", "", say("There is no backup yet."))
    elif timezone.now() - last.at > BACKUP_AGE:
        days = (timezone.now() - last.at).days
        yield Trouble("backup", "", say("The last backup is {days} days old.", days=days))


def store() -> Iterator[Trouble]:
    """Look for recordings that have waited long to be uploaded, if there is an object store."""
    if settings.FLEET_S3 is None:
        return
    now = timezone.now()
    waiting = Recording.objects.filter(
        place=Place.DIRECTORY, begins_at__gt=now - STORE_LEFT, ends_at__lt=now - STORE_AGE
    )
    if (since := waiting.aggregate(first=Min("ends_at"))["first"]) is not None:
        words = say(
            "Recordings have waited for the object store for {age:age}: the log of the store process says why.",
            age=(now - since).total_seconds(),
        )
        yield Trouble("store", "", words)


class Certificates:
    """Looks once an hour at the certificate that browsers get, and at that of the links to bridges."""

    def __init__(self) -> None:
        self._looked_s = float("-inf")
        self._times: dict[str, Times] = {}

    def __call__(self) -> Iterator[Trouble]:
        """Return the certificates that end soon."""
        if time.monotonic() - self._looked_s > CERTIFICATES_S:
            self._looked_s = time.monotonic()
            self._times.update(_times())  # one that cannot be read now ends as before
        for name, (begins, ends) in self._times.items():
            # Caddy's own authority signs for half a day, and it renews those when a third is left.
            if ends - timezone.now() < min(CERTIFICATE_LEFT, (ends - begins) / 4):
                words = say("The certificate of {name} ends on {day:day}.", name=name, day=ends)
                yield Trouble("certificate", name[:200], words)


def _times() -> Iterator[tuple[str, Times]]:
    """Return when certificates begin and end, without those that cannot be read: other checks say why."""
    origin = urlsplit(settled_origin())
    if origin.scheme == "https" and origin.hostname:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE  # only its date is read
        address = (origin.hostname, origin.port or 443)
        with (
            suppress(OSError, ValueError),
            socket.create_connection(address, CONNECT_S) as plain,
            context.wrap_socket(plain, server_hostname=origin.hostname) as secured,
        ):
            yield origin.netloc, _times_of(secured.getpeercert(binary_form=True) or b"", der=True)
    if settings.FLEET_LINK_CERT:
        with suppress(OSError, ValueError):
            yield (
                str(settings.FLEET_LINK_CERT),
                _times_of(Path(settings.FLEET_LINK_CERT).read_bytes(), der=False),
            )


def _times_of(content: bytes, *, der: bool) -> Times:
    certificate = (x509.load_der_x509_certificate if der else x509.load_pem_x509_certificate)(content)
    return certificate.not_valid_before_utc, certificate.not_valid_after_utc
