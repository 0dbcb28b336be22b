"""Records who watched a robot's camera: from the first picture shown to the last.

The log must also prove that a camera was not watched. So each viewing, however short, has its own records: a
start and an end. A long viewing is recorded in parts of `PART_S`, so a part that is open for much longer
belongs to a web process that died. If a person starts viewings so often that their record budget is used up,
the next picture is shown later.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Iterator
from datetime import datetime, timedelta
from functools import lru_cache
from uuid import UUID

import msgspec
from django.db import DatabaseError
from django.db.models import Exists, OuterRef
from msgspec import Struct

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from robots.shared.messages.type_names import bare
from robots.shared.wire import Refusal
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.records.repeat_suppression import RecordBudgets

log = logging.getLogger(__name__)

_PICTURES = frozenset(
    {
        "sensor_msgs/Image",
        "sensor_msgs/CompressedImage",
        "stereo_msgs/DisparityImage",
        "theora_image_transport/Packet",
    }
)
PART_S = 3600.0
ABANDONED_AFTER = timedelta(seconds=2 * PART_S)  # then the web process has died, and the end is unknown
SEARCHED = timedelta(days=30)  # older abandoned viewings are not searched

TOO_MANY_CAMERAS = Refusal(
    "busy", "You have opened cameras too often. This camera will appear in a moment.", "audit"
)

_budgets = RecordBudgets()
# Separate for small pictures, so that a page full of small pictures does not delay the camera of the holder.
_small_budgets = RecordBudgets()


def is_picture(type_name: str) -> bool:
    """Return whether messages of this type are pictures, of which each viewing is recorded."""
    return bare(type_name) in _PICTURES


class _Shown(Struct):
    """The fields of a `wire.Sample` that this module reads."""

    topic: str = ""
    type: str = ""
    refusal: Refusal | None = None


_shown = msgspec.json.Decoder(_Shown)


@lru_cache(maxsize=64)  # all viewers get the same text, so it is decoded only once
def _camera_of(message: str) -> str | None:
    """Return the topic if this sample is a picture, else None."""
    shown = _shown.decode(message)
    return shown.topic if is_picture(shown.type) and shown.refusal is None else None


class _Viewing(Struct):
    since_s: float
    start: asyncio.Future[Record | None]


class CameraAudit:
    """Records the camera viewings of one connection. Runs on the event loop and waits for nothing."""

    def __init__(self, user: User, robot_id: UUID, robot_name: str) -> None:
        self._user = user
        self._robot_id = robot_id
        self._robot_name = robot_name
        self._open: dict[str, _Viewing] = {}

    def begin_if_picture(self, message: str) -> bool:
        """Begin or continue a viewing if this encoded sample is a picture. Return whether it may be shown."""
        camera = _camera_of(message)
        return camera is None or self.begin_or_continue(camera)

    def begin_or_continue(self, camera: str, *, small: bool = False) -> bool:
        """Begin or continue a viewing of this camera. Return whether its picture may be shown.

        `small`: the page asked for small pictures. Returns False if the person's record budget is used up:
        the viewing could not be recorded.
        """
        viewing = self._open.get(camera)
        if viewing is not None and time.monotonic() - viewing.since_s > PART_S:
            self.end_viewing(camera, "goes_on")
            viewing = None
        if viewing is None:
            budgets = _small_budgets if small else _budgets
            if budgets.wait_s(self._user.pk, time.monotonic()) > 0.0:
                return False
            start = asyncio.ensure_future(in_database(self._record_start, camera))
            self._open[camera] = _Viewing(time.monotonic(), start)
        return True

    def end_viewing(self, camera: str, outcome: str = "closed") -> None:
        viewing = self._open.pop(camera, None)
        if viewing is not None:
            run_in_background(self._record_end_later(viewing, time.monotonic() - viewing.since_s, outcome))

    def end_all(self) -> None:
        """End all viewings: the connection is gone."""
        for camera in list(self._open):
            self.end_viewing(camera)

    async def _record_end_later(self, viewing: _Viewing, duration_s: float, outcome: str) -> None:
        start = await viewing.start
        if start is not None:
            await in_database(_record_end, start, self._user, round(duration_s, 1), outcome)

    def _record_start(self, camera: str) -> Record | None:
        """Record the start. A failure is logged, and the camera is still shown."""
        try:
            return audit.record(
                "camera.start",
                actor=self._user,
                robot_id=self._robot_id,
                robot_name=self._robot_name,
                parameters={"camera": camera},
            )
        except (AuditUnavailable, DatabaseError) as error:
            log.error("The start of a viewing by %s of %s was not recorded: %s", self._user.pk, camera, error)
            return None


def _record_end(start: Record, user: User, duration_s: float, outcome: str) -> None:
    try:
        if not Record.objects.filter(of=start, kind="camera.end").exists():
            figures = {"duration_s": duration_s}
            audit.record("camera.end", actor=user, of=start, outcome=outcome, parameters=figures)
    except (AuditUnavailable, DatabaseError) as error:
        log.error("The end of record %s was not recorded: %s", start.pk, error)


def close_abandoned(now: datetime) -> Iterator[None]:
    """Record an end with the outcome "unknown" for each viewing that a dead web process left open. Yield after each."""
    ends = Record.objects.filter(of=OuterRef("pk"), kind="camera.end")
    starts = Record.objects.filter(kind="camera.start", at__gt=now - SEARCHED, at__lt=now - ABANDONED_AFTER)
    for start in starts.exclude(Exists(ends)).order_by("id"):
        audit.record("camera.end", of=start, outcome="unknown")
        yield
