"""Who watched a robot's camera, on record: from the first picture that somebody was shown to the last.

That nobody watched must be worth something, so each stretch has its own record, however short. A long one is told in
parts: whatever is open for longer than a part was left by a web process that died. A watch has two records: who begins
and ends many in a short time is shown the next one later.
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

from fleet import audit
from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.wire import Refusal
from teleop.background.database import in_database
from teleop.background.tasks import run_in_background
from teleop.recording.repeat_suppression import RecordBudgets

log = logging.getLogger(__name__)

PICTURES = frozenset(
    {
        "sensor_msgs/Image",
        "sensor_msgs/CompressedImage",
        "stereo_msgs/DisparityImage",
        "theora_image_transport/Packet",
    }
)
PART_S = 3600.0
LEFT = timedelta(seconds=2 * PART_S)  # open for so long: nobody will say how it ended
SOUGHT = timedelta(days=30)  # what is left is sought for so far back

_ration = RecordBudgets()


class _Shown(Struct):
    """What matters here of a `wire.Sample`."""

    topic: str = ""
    type: str = ""
    refusal: Refusal | None = None


_shown = msgspec.json.Decoder(_Shown)


@lru_cache(maxsize=64)  # all who look are handed the same text: it is looked into once
def _camera_of(message: str) -> str | None:
    """The topic, if this is a picture."""
    shown = _shown.decode(message)
    return shown.topic if shown.type in PICTURES and shown.refusal is None else None


class _Watch(Struct):
    since_s: float
    start: asyncio.Future[Record | None]


class CameraAudit:
    """The cameras that one connection of one person is shown. On the event loop; waits for nothing."""

    def __init__(self, user: User, robot_id: UUID, robot_name: str) -> None:
        self._user = user
        self._robot_id = robot_id
        self._robot_name = robot_name
        self._open: dict[str, _Watch] = {}

    def shown(self, message: str) -> bool:
        """A message of a topic, as encoded, may go to the person: if it is a picture, they watch.

        False: it may not, for this person has begun to watch so often that it would not go on record.
        """
        camera = _camera_of(message)
        if camera is None:
            return True
        watch = self._open.get(camera)
        if watch is not None and time.monotonic() - watch.since_s > PART_S:
            self.end(camera, "goes_on")
            watch = None
        if watch is None:
            if _ration.wait_s(self._user.pk, time.monotonic()) > 0.0:
                return False
            start = asyncio.ensure_future(in_database(self._record_start, camera))
            self._open[camera] = _Watch(time.monotonic(), start)
        return True

    def end(self, camera: str, outcome: str = "closed") -> None:
        """The person is shown this camera no more, if they were."""
        watch = self._open.pop(camera, None)
        if watch is not None:
            run_in_background(self._told_end(watch, time.monotonic() - watch.since_s, outcome))

    def end_all(self) -> None:
        """The connection is gone."""
        for camera in list(self._open):
            self.end(camera)

    async def _told_end(self, watch: _Watch, duration_s: float, outcome: str) -> None:
        start = await watch.start
        if start is not None:
            await in_database(_record_end, start, self._user, round(duration_s, 1), outcome)

    def _record_start(self, camera: str) -> Record | None:
        """That it cannot be recorded keeps nobody from looking: it is logged."""
        try:
            return audit.record(
                "camera.start",
                actor=self._user,
                robot_id=self._robot_id,
                robot_name=self._robot_name,
                parameters={"camera": camera},
            )
        except (audit.AuditUnavailable, DatabaseError) as error:
            log.error("that %s watches %s was not recorded: %s", self._user.pk, camera, error)
            return None


def _record_end(start: Record, user: User, duration_s: float, outcome: str) -> None:
    try:
        if not Record.objects.filter(of=start, kind="camera.end").exists():
            figures = {"duration_s": duration_s}
            audit.record("camera.end", actor=user, of=start, outcome=outcome, parameters=figures)
    except (audit.AuditUnavailable, DatabaseError) as error:
        log.error("the end of record %s was not recorded: %s", start.pk, error)


def close_abandoned(now: datetime) -> Iterator[None]:
    """Put an end on record, step by step, of what a web process that died has left open. How it ended is unknown."""
    ends = Record.objects.filter(of=OuterRef("pk"), kind="camera.end")
    starts = Record.objects.filter(kind="camera.start", at__gt=now - SOUGHT, at__lt=now - LEFT)
    for start in starts.exclude(Exists(ends)).order_by("id"):
        audit.record("camera.end", of=start, outcome="unknown")
        yield
