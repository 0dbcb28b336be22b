"""Messages of the fleet page: a card for each robot, from the web process."""

from __future__ import annotations

from msgspec import Struct

from robots.shared.wire.base import PendingStop, Refusal, Worded
from robots.shared.wire.health import Health
from robots.shared.wire.limbs import Limb, LimbState
from robots.shared.wire.navigation import GoProgress, Location
from robots.shared.wire.state import MovesAlthoughStopped, Phase, StopState, Verdict
from robots.shared.wire.tasks import DriveByProgress, Motion, Speech


class FleetTurn(Struct, frozen=True):
    """Whose turn it is in a lesson, and who is next: for the fleet page and the lab's monitor."""

    person: str | None = None  # is called, or drives
    driving: bool = False
    seconds: float | None = None  # until the end of the turn; of a person who is called: to take control
    next: str | None = None


class Booked(Struct, frozen=True):
    """A booking of the robot. `seconds`: until its end if it runs now, else until its start."""

    name: str  # of the person
    mine: bool
    seconds: float
    turn: FleetTurn | None = None  # of a lesson that runs now


class FleetSpeed(Struct, frozen=True):
    """The robot's speed, rounded: a robot that stands has zeros."""

    vx: float
    vy: float
    w: float


class FleetState(Worded, frozen=True):
    """The part of a robot's `State` that the fleet page shows. Fields have the same meaning; figures are rounded."""

    phase: Phase
    text: str
    stop: StopState
    verdict: Verdict  # without its limits
    odometry: FleetSpeed | None
    battery_percent: float | None
    charging: bool | None
    holder: str | None
    battery_left_min: int | None = None
    unseen_s: float | None = None
    watchdog_missing: bool = False
    health: Health | None = None
    stands: bool | None = None
    moves_although_stopped: MovesAlthoughStopped | None = None
    location: Location | None = None
    motion: Motion | None = None
    speech: Speech | None = None
    drive_by: DriveByProgress | None = None
    going: GoProgress | None = None
    limbs: dict[Limb, LimbState] = {}  # those that move
    recorded_by: str | None = None  # who records it now; None: nobody


class FleetCard(Struct, frozen=True):
    """One robot on the fleet page. `state` None: not known, and `refusal` has the reason."""

    state: FleetState | None
    refusal: Refusal | None = None
    seen_at: float | None = None  # as in `BridgeGone`
    may_clear: bool = False  # this person may clear its stop from here
    pending: PendingStop | None = None  # as `stop` in `BridgeGone`; also sent while the state is known
    booked: Booked | None = None  # the present booking
    next_booked: Booked | None = None  # the next booking within a day
    free_in_s: float | None = None  # until its next free time; None: not within a day
    out: Refusal | None = None  # why nobody can book it now: it is out of service


class Beat(Struct, frozen=True, tag_field="t", tag="beat"):
    """Nothing changed: the console still watches the robots. Sent while `fleet` has no news."""


class Fleet(Struct, frozen=True, tag_field="t", tag="fleet"):
    """The robots that this person may see, by slug. Sent first, and when other robots are visible than before."""

    robots: dict[str, FleetCard]
    # Only the robots whose card changed since the message before are here; the others are as they were
    changed: bool = False
