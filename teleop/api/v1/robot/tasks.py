"""Speech, motions and other tasks by a program, and the outcomes of tasks."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

from asgiref.sync import async_to_sync
from drf_spectacular.utils import OpenApiParameter
from msgspec import Meta, Struct, structs
from rest_framework.response import Response

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from robots.access.selectors import supervises
from robots.link.connections import LinkRefused
from robots.link.state_reader import state_once
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import MotionOffer, NotDone, Refusal, StopState
from robots.shared.wire.base import FARTHEST_HEAD_RAD
from teleop.api.v1.framework.long_poll import LongPoll
from teleop.api.v1.framework.operation import Operation, operation
from teleop.api.v1.framework.parameters import Time, whole_number
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.framework.rates import place_in
from teleop.api.v1.programs.outcomes import outcomes
from teleop.api.v1.programs.registry import programs
from teleop.api.v1.robot.control import ProgramView
from teleop.webhooks.event_reader import newest_record

LONGEST_WAIT_S = 30
CHECK_S = 0.2
CLEARED_S = 3.0

# Kinds of tasks whose outcome a program can read, by the kind of the record of their request: see `starts`
_FOLLOWED: dict[str, wire.TaskKind] = {}
_NOT_RECORDED = Refusal("not_recorded", "The console took the request, and has no record of it yet.", "audit")
_NOT_CLEARED = Refusal("not_cleared", "The stop is not cleared: look at the robot’s state.", "stop")


class SayRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A text for the robot to speak."""

    text: Annotated[str, Meta(min_length=1, max_length=500)]
    language: Annotated[str, Meta(min_length=2, max_length=35)]  # BCP 47, such as en-GB
    topic: Annotated[str, Meta(max_length=255)] | None = None  # null: the topic that is chosen for speech now


class ClearRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """The number of the stop as the program read it: a stop pressed since is not cleared unseen."""

    number: Annotated[int, Meta(ge=0)]


class TaskEntry(Struct, frozen=True):
    """A task that somebody asked a robot for. `outcome` null: it is not over."""

    number: int
    kind: str  # its name
    robot: str
    by: str
    asked_at: Time
    outcome: str | None
    ended_at: Time | None
    text: str  # why the task ended in this way, or the robot's own words


class MotionList(Struct, frozen=True):
    """The motions that a robot offers; `text`: why there are none."""

    motions: list[MotionOffer]
    text: str


# Requests that list motions at the same time. Each waits in a thread, perhaps for a robot that does not
# answer, and pages need threads, too.
MOST_LISTING = 6

_listing = threading.BoundedSemaphore(MOST_LISTING)
_BUSY = Refusal("busy", "Motions of too many robots are asked for at once: try again in a moment.", "robot")
_STARTING = Refusal(
    "busy", "Another task of this kind is being started. Try again when it has started.", "wire"
)
_OVERTAKEN = Refusal("cancelled", "This task was cancelled before it started.", "lease")
_of_robot = partial(operation, refuses=(404, 409))


def acts(name: str, summary: str, kind: wire.TaskKind, **more: Any) -> Operation:
    """Make a method an operation on tasks of this kind. A token needs the kind's scope."""
    return _of_robot(name, summary, scope=Scope(kind.scope), **more)


def starts(name: str, summary: str, kind: wire.TaskKind, **more: Any) -> Operation:
    """Make a method an operation that calls `TasksBase.start`. Programs can read the outcomes of this kind of tasks."""
    _FOLLOWED[kind.record] = kind
    return acts(name, summary, kind, keyed=True, answer=TaskEntry, status=202, **more)


class TasksBase(ProgramView):
    """Base of the views that request tasks."""

    kind: wire.TaskKind  # of its tasks
    tag = "tasks"

    def start(self, robot: Robot, make: Callable[[int, int], Any], part: str = "") -> Response:
        """Request a task, and return the answer 202 with its status and address.

        `part`: the part of the robot that the task moves, if several parts have tasks of this kind. Raises
        `Problem` or `NotDone`.
        """
        connection, kind = self.connected(robot), self.kind

        # A robot that starts late surprises people. So a task does not wait for another one, and does not
        # start if its cancel came first.
        def in_time(fence: int, seq: int) -> Any:
            if connection.cancelled_s.get(part or kind.name, -math.inf) > self.came_s:
                raise NotDone(_OVERTAKEN)
            return make(fence, seq)

        with place_in(connection.starting.setdefault(kind.name, threading.Lock()), _STARTING):
            control, newest = connection.control, newest_record()
            async_to_sync(connection.request)(in_time)
            session = control.session if control else None
            requests = Record.objects.filter(pk__gt=newest, kind=kind.record, session_id=session, of=None)
            found = requests.select_related("actor").order_by("pk").first()
        if found is None:
            raise Problem(_NOT_RECORDED)
        address = f"/api/v1/robots/{robot.slug}/tasks/{found.pk}"
        return Response(wire.to_builtins(_entry(found, robot)), 202, headers={"Location": address})

    def cancel(self, slug: str, make: Callable[[int, int], Any], part: str = "") -> None:
        """End the task of this kind, or of this part.

        A task that was requested earlier, but not sent yet, does not start.
        """
        connection, what = self.connected(self.robot(slug)), part or self.kind.name

        def noted(fence: int, seq: int) -> Any:
            connection.cancelled_s[what] = max(self.came_s, connection.cancelled_s.get(what, -math.inf))
            return make(fence, seq)

        async_to_sync(connection.request)(noted)


class SpeechView(TasksBase):
    """`/robots/{slug}/speech`."""

    kind = wire.SPEECH

    @starts(
        "speech_say",
        "Speak a text",
        kind,
        examples={"Greeting": {"text": "Hello!", "language": "en-GB"}},
    )
    def post(self, slug: str, body: SayRequest) -> Response:
        """Needs control. The answer’s header Location is the address of its status."""
        return self.start(
            self.robot(slug),
            lambda fence, seq: wire.Say(fence, body.text, body.language, body.topic, seq),
        )

    @acts("speech_cancel", "Cancel speech", kind)
    def delete(self, slug: str) -> None:
        """The speech of this program’s control."""
        self.cancel(slug, wire.SayCancel)


class MotionsView(TasksBase):
    @_of_robot("motions_list", "List motions", scope=Scope.READ)
    def get(self, slug: str) -> MotionList:
        """In the robot’s own words."""
        connection = self.connection(self.robot(slug))
        offers = connection.offers
        if offers is None:
            with place_in(_listing, _BUSY):
                offers = async_to_sync(connection.offered)()
        return MotionList(offers.motions, offers.motions_text)


class MotionView(TasksBase):
    kind = wire.MOTION

    @starts("motions_play", "Play a motion", kind)
    def post(self, slug: str, name: str) -> Response:
        """Needs control. The answer’s header Location is the address of its status."""
        return self.start(self.robot(slug), lambda fence, seq: wire.Play(fence, name[:100], seq))


class MotionCancelView(TasksBase):
    kind = wire.MOTION

    @acts("motions_cancel", "Cancel the motion", kind)
    def delete(self, slug: str) -> None:
        """Cancels the motion that this program started."""
        self.cancel(slug, wire.PlayCancel)


class DriveByRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A distance straight on (negative: backwards), or an angle on the spot (positive: left): one of the two."""

    distance_m: float | None = None
    angle_rad: float | None = None
    speed_mps: float | None = None  # of a distance; null: a gentle one
    speed_radps: float | None = None  # of an angle


class DriveByView(TasksBase):
    """`/robots/{slug}/drive-by`."""

    kind, tag = wire.DRIVE_BY, "control"

    @starts(
        "drive_by",
        "Drive a distance, or turn by an angle",
        kind,
        examples={"One metre on": {"distance_m": 1.0}},
    )
    def post(self, slug: str, body: DriveByRequest) -> Response:
        """The bridge drives it through the gate, and ends it with an outcome: done, held_back, stopped, replaced by a
        stick, and others. Needs control. While it drives, ask for something at least every 10 s, such as its status."""
        asked = structs.asdict(body)
        try:
            wire.browser_message(wire.encode(wire.DriveBy(1, **asked)))
        except ValueError as error:
            raise Problem(
                Refusal("invalid", say("The body does not fit: {error}.", error=error), "wire")
            ) from error
        return self.start(self.robot(slug), lambda fence, seq: wire.DriveBy(fence, **asked, seq=seq))

    @acts("drive_by_cancel", "End the drive", kind)
    def delete(self, slug: str) -> None:
        """The robot stands."""
        self.cancel(slug, wire.DriveByCancel)


class LookAheadView(TasksBase):
    """`/robots/{slug}/look-ahead`."""

    kind = wire.LOOK_AHEAD

    @acts("look_ahead", "Turn the head to where the robot drives", kind)
    def post(self, slug: str) -> None:
        """Needs control."""
        self.send(slug, wire.LookAhead)


class HeadRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Angles from where the head was sent last, radians; positive: left, up."""

    pan: Annotated[float, Meta(ge=-FARTHEST_HEAD_RAD, le=FARTHEST_HEAD_RAD)] = 0.0
    tilt: Annotated[float, Meta(ge=-FARTHEST_HEAD_RAD, le=FARTHEST_HEAD_RAD)] = 0.0


class HeadView(TasksBase):
    """`/robots/{slug}/head`."""

    kind = wire.TURN_HEAD

    @acts("head_turn", "Turn the head", kind)
    def post(self, slug: str, body: HeadRequest) -> None:
        """Needs control. Within the limits of its joints."""
        self.send(slug, lambda fence, seq: wire.TurnHead(fence, body.pan, body.tilt, seq))


class ClearView(TasksBase):
    tag = "stop"

    @_of_robot("stop_clear", "Clear the emergency stop", scope=Scope.DRIVE)
    def post(self, slug: str, body: ClearRequest) -> StopState:
        """For the holder of control, supervisors and staff. Nothing moves."""
        robot = self.robot(slug)
        connection = self.connection(robot)
        refusal = async_to_sync(connection.send_checked)(wire.Clear(body.number))
        if refusal is not None:
            raise Problem(refusal)
        until_s = time.monotonic() + CLEARED_S
        while time.monotonic() < until_s:
            try:
                stop = state_once(robot.id, link_address(robot)).stop
            except LinkRefused as error:
                raise NotDone(error.refusal) from error
            if stop.state == "clear":
                return stop
            time.sleep(CHECK_S)
        raise Problem(_NOT_CLEARED)


class TaskView(ProgramView):
    tag = "tasks"

    @_of_robot(
        "tasks_read",
        "Read what came of a task",
        scope=Scope.READ,
        answer=TaskEntry,
        refuses=(400, 404),
        parameters=[
            OpenApiParameter(
                "wait", int, description=f"Wait so many seconds for its end, 0 to {LONGEST_WAIT_S}."
            )
        ],
    )
    def get(self, slug: str, number: int) -> TaskEntry | LongPoll:
        """From the log. Only supervisors of the robot and staff read tasks of other people."""
        robot = self.robot(slug)
        requests = Record.objects.filter(pk=min(number, 2**62), robot_id=robot.id, of=None)
        found = requests.filter(kind__in=list(_FOLLOWED)).first()
        if found is None or not (found.actor_id == str(self.person.pk) or supervises(self.person, robot)):
            raise Problem(NOT_FOUND)
        wait_s = whole_number(self.request, "wait", 0, LONGEST_WAIT_S, least=0)
        self.keep_control(slug)
        entry = _entry(found, robot)
        if entry.outcome is not None or not wait_s or self.request.method == "HEAD":
            return entry
        sign_in = self.program_sign_in()
        return LongPoll(
            entry,
            lambda: outcomes.wait(number, wait_s, lambda: programs.found(slug, sign_in)),
            lambda: _entry(found, robot),
        )


def _entry(start: Record, robot: Robot) -> TaskEntry:
    kind = _FOLLOWED[start.kind]
    end = Record.objects.filter(kind=kind.outcome, of=start).select_related("content").first()
    return TaskEntry(
        number=start.pk,
        kind=kind.name,
        robot=robot.slug,
        by=start.actor_name,
        asked_at=start.at,
        outcome=end.outcome if end else None,
        ended_at=end.at if end else None,
        text=end.details.get("words", "") if end else "",
    )


# Views of kinds of tasks with one address each
VIEWS: tuple[type[TasksBase], ...] = (SpeechView, DriveByView, LookAheadView, HeadView)
