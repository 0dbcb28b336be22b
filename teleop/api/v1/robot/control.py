"""Control by a program: take it, renew it, drive, give it back."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Annotated, Any, Literal
from uuid import UUID

from asgiref.sync import async_to_sync
from django.conf import settings
from django.utils import timezone
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from robots.registry.models import Robot
from robots.registry.selectors import robot_facts
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Booked, Control, ControlState, Limits, Refusal
from teleop.api.v1.framework.operation import ApiView, entry_of, operation
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.programs.connection import ProgramConnection, ProgramSignIn, Velocity
from teleop.api.v1.programs.registry import UNUSED_S, programs
from teleop.control import lease_checks
from teleop.control.allowed.scopes import ACTING
from teleop.control.selectors import lease_of

LONGEST_S = 0.5  # of a velocity

_NOT_TAKEN = Refusal("no_lease", "This program does not have control: take it first.", "lease")
_ELSEWHERE = Refusal(
    "other_process",
    "This program has control by another connection: through another web process of the console, or a WebSocket of "
    "its own. Send all its requests to one process (a proxy can choose by the header Authorization), or take control "
    "again: that moves it here.",
    "lease",
)


class ControlEntry(Struct, frozen=True):
    """The holder of control of a robot, as this program sees it."""

    # "yours": this program has control; "unknown": this program has no connection to the robot yet
    state: ControlState | Literal["unknown"]
    holder: str | None = None
    fence: int | None = None  # only if this program has control
    session: UUID | None = None  # control session, as in the log
    term_s: float | None = None  # until control ends, unless it is renewed
    unused_s: float | None = None  # control also ends after this time without a request of the program
    requests: list[wire.Request] = []  # people in line, in order; shown to the holder and to supervisors
    asking: int | None = None  # this program's number in line; null: not in line
    ahead: int | None = None  # programs and people in line before this one; null: not in line
    offer_s: float | None = None  # for this time only this program can take control
    refusal: Refusal | None = None  # why taking control would be refused now
    booked: Booked | None = None
    next_booked: Booked | None = None
    out_s: float | None = None  # until an out-of-service period ends this program's control; null: not soon


class TakeControl(Struct, frozen=True, forbid_unknown_fields=True):
    """With `reason`, a supervisor takes over from the holder. The owner of the slot, or who leads the lesson, takes
    control back with an empty one."""

    reason: Annotated[str, Meta(max_length=200)] | None = None


class HandOver(Struct, frozen=True, forbid_unknown_fields=True):
    """Give control to the person in line with this number."""

    number: int


class VelocityRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Velocities in the robot's frame (REP 103), m/s and rad/s, and for how long."""

    forward_mps: Annotated[float, Meta(ge=-5.0, le=5.0)] = 0.0
    left_mps: Annotated[float, Meta(ge=-5.0, le=5.0)] = 0.0
    turn_radps: Annotated[float, Meta(ge=-10.0, le=10.0)] = 0.0
    seconds: Annotated[float, Meta(gt=0.0, le=LONGEST_S)] = 0.3


class Driven(Struct, frozen=True):
    """How long the velocity was sent; a newer one ends it early. The robot's state shows what the gate allowed."""

    seconds: float
    fence: int


_control = partial(operation, scope=ACTING, refuses=(404, 409))


class ProgramView(ApiView):
    """Base of the views that act through a program's connection, and do not change the robot's row."""

    tag = "control"

    def robot(self, slug: str) -> Robot:
        """Return one of the robots that the person may see, for reading only. Raises `Problem`: not found."""
        return self.known_robot(slug)[0].robot

    def concerned(self, slug: str, **_asked: Any) -> Iterable[Robot]:
        return [self.robot(slug)]

    def program_sign_in(self) -> ProgramSignIn:
        """Return how the program is signed in."""
        host = self.request.get_host()
        name, origin = "Authorization", None
        if self.token is None:
            name, origin = "Cookie", f"{'https' if settings.FLEET_TLS else 'http'}://{host}"
        headers = ((name, self.request.headers.get(name, "")),)
        return ProgramSignIn(self.sign_in, self.person.pk, headers, host, origin)

    def keep_control(self, slug: str) -> None:
        """Count this request as use of the program's control."""
        programs.found(slug, self.program_sign_in())

    def connection(self, robot: Robot) -> ProgramConnection:
        """Return the program's connection, a new one if there is none. Raises `NotDone`."""
        found: ProgramConnection = async_to_sync(programs.connection)(robot.slug, self.program_sign_in())
        return found

    def connected(self, robot: Robot) -> ProgramConnection:
        """Return the connection that has control. Raises `Problem`."""
        found = programs.found(robot.slug, self.program_sign_in())
        if found is None or found.fence is None:
            raise Problem(_ELSEWHERE if self.holds_elsewhere(robot) else _NOT_TAKEN)
        return found

    def send(self, slug: str, make: Callable[[int, int], Any]) -> None:
        """Request what `make` builds from fence and sequence number. Raises `Problem` or `NotDone`."""
        async_to_sync(self.connected(self.robot(slug)).request)(make)

    def holds_elsewhere(self, robot: Robot) -> bool:
        """Return whether the lease is this program's.

        Callers first look at the connections of this process.
        """
        lease = lease_of(robot.id)
        if lease is None or lease_checks.lapse_reason(lease, timezone.now()) is not None:
            return False
        return lease.tab.sign_in == lease_checks.fingerprint(self.program_sign_in().key)


class ControlView(ProgramView):
    @_control("control_read", "Read who has control", scope=Scope.READ, refuses=(404,))
    def get(self, slug: str) -> ControlEntry:
        """Reading keeps a program's control in use."""
        robot = self.robot(slug)
        found = programs.found(slug, self.program_sign_in())
        if found is not None and found.control is not None:
            return _entry(found.control)
        lease = lease_of(robot.id)
        if lease is None or lease_checks.lapse_reason(lease, timezone.now()) is not None:
            return ControlEntry("free")
        elsewhere = _ELSEWHERE if self.holds_elsewhere(robot) else None
        return ControlEntry("unknown", holder=lease.name, refusal=elsewhere)

    @_control("control_take", "Take control", keyed=True, examples={"Take control": {}})
    def post(self, slug: str, body: TakeControl) -> ControlEntry:
        """By the rules of the pages: account, booking, lease. Control ends with the term, with the slot, when it is
        given back, and when the program asks for nothing for 30 s."""
        connection = self.connection(self.robot(slug))
        if connection.fence is not None:
            return _entry(connection.control)
        message = wire.Take() if body.reason is None else wire.TakeOver(body.reason)
        return _entry(async_to_sync(connection.change)(message))

    @_control("control_release", "Release control")
    def delete(self, slug: str) -> None:
        """The robot stops."""
        async_to_sync(self.connected(self.robot(slug)).change)(wire.Release())


class RenewView(ProgramView):
    @_control("control_renew", "Renew control")
    def post(self, slug: str) -> ControlEntry:
        """Start the term again; or extend the slot while nobody else has booked."""
        return _entry(async_to_sync(self.connected(self.robot(slug)).change)(wire.Renew()))


class AskView(ProgramView):
    @_control("control_ask", "Wait in line for control")
    def post(self, slug: str) -> ControlEntry:
        """Read control at least every 30 s; an offer holds for `offer_s`."""
        return _entry(async_to_sync(self.connection(self.robot(slug)).change)(wire.Ask()))

    @_control("control_leave", "Leave the line")
    def delete(self, slug: str) -> None:
        """Does nothing for a program that is not in line."""
        async_to_sync(self.connection(self.robot(slug)).change)(wire.AskCancel())


class HandOverView(ProgramView):
    @_control("control_hand_over", "Hand control over", keyed=True)
    def post(self, slug: str, body: HandOver) -> None:
        """To somebody who waits in line."""
        async_to_sync(self.connected(self.robot(slug)).change)(wire.HandOver(body.number))


class VelocityView(ProgramView):
    @_control(
        "velocity",
        "Drive for at most 0.5 s",
        scope=Scope.DRIVE,
        examples={"Forward": {"forward_mps": 0.2, "seconds": 0.5}},
    )
    def post(self, slug: str, body: VelocityRequest) -> Driven:
        """The dead-man rule and the gate apply, as for a stick. For more than a first try use the WebSocket, or
        `drive-by`."""
        robot = self.robot(slug)
        connection = self.connected(robot)
        fence = connection.fence or 0
        seconds = async_to_sync(connection.drive)(
            _velocity(robot, body, _share(connection.control)), body.seconds
        )
        return Driven(round(seconds, 3), fence)


def _share(control: Control | None) -> float:
    """Return the part of the robot's speed limits that the present lesson leaves."""
    return control.tasks.max_share if control is not None and control.tasks is not None else 1.0


def _velocity(robot: Robot, asked: VelocityRequest, share: float = 1.0) -> Velocity:
    """Return the stick position that the bridge reads as this velocity. Raises `Problem`: too fast.

    `share`: the largest part of the robot's limits, if the robot's own part is not smaller.
    """
    facts = robot_facts(robot)
    share = min(share, facts.max_share)
    limits: Limits = facts.limits
    forward = limits.forward_mps * share
    parts: dict[str, Any] = {}
    for name, value, most in (
        ("x", asked.forward_mps, forward if asked.forward_mps >= 0.0 else min(forward, limits.reverse_mps)),
        ("y", asked.left_mps, limits.lateral_mps * share),
        ("w", asked.turn_radps, limits.turn_radps * share),
    ):
        if abs(value) > most + 1e-9:
            text = say(
                "{name} takes at most {most:.2f} in this direction; {value:.2f} were asked for.",
                name=robot.name,
                most=most,
                value=abs(value),
            )
            raise Problem(Refusal("too_fast", text, "wire", {"limit": most, "asked": value}))
        parts[name] = value / most if most > 0.0 else 0.0
    if asked.forward_mps < 0.0 and facts.reverse_steering == "car":
        parts["w"] = -parts["w"]
    return Velocity(**parts, share=share)


def _entry(control: Control | None) -> ControlEntry:
    if control is None:
        return ControlEntry("unknown")
    return entry_of(
        ControlEntry,
        control,
        session=UUID(control.session) if control.session else None,
        term_s=control.remaining_s,
        unused_s=UNUSED_S if control.state == "yours" else None,
    )
