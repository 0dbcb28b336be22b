"""One protocol for all tasks: recorded, begun, reported, and ended once, with a cause.

`parts.py` lists the parts of a bridge, one for each kind of task. `HolderTasks` passes requests on to them, and tells
all of them each event that may end a task. For each `Cause` a part declares its `Reaction`; a class that forgets one
cannot be defined.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, TypeVar

from robots.bridge.audit.records import Records, Requester
from robots.bridge.tasks.named_ends import ShowsEnd
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.geometry.poses import Velocity
from robots.shared.sentences import Sentence
from robots.shared.wire import Grant, Refusal

if TYPE_CHECKING:
    from robots.bridge.gate.gate import Gate
    from robots.bridge.lease.lease_guard import LeaseGuard

HALTED = Refusal(
    "halted", "It was not done: control ended or the robot was stopped before it was recorded.", "robot"
)


class Cause(Enum):
    """Why a task ends. Without one of these it ends as the robot reports: done, failed, rejected."""

    CANCELLED = "its holder, or a person who may, cancelled it"
    SUPERSEDED = "the holder’s own drive input took over"
    GATE = "the gate forbids the base’s drive to go on"
    HALTED = "the base was halted: the page is gone or back, the stop was cleared, input goes elsewhere"
    ROBOT_GONE = "the robot’s ROS was lost"
    STOPPED = "the robot was stopped"
    CONTROL_ENDED = "its holder lost control"
    PAGE_LEFT = "its holder’s page is gone"
    LINK_LOST = "its holder’s page stays away"
    UNRECORDED = "records cannot be written"
    BRIDGE_ENDED = "the bridge ends"


class Reaction(Enum):
    """The answer of a part to a cause."""

    GO_ON = "nothing ends"
    DROP = "refuse what has not begun"
    HALT = "end what runs; what has not begun is checked again when it is due"
    END = "both"
    LEAVE = "both, and record the outcome now: nobody watches the robot any more"


# Of a task that goes on only while its holder has control, is connected and is recorded.
WHILE_HELD: Mapping[Cause, Reaction] = {
    Cause.CANCELLED: Reaction.END,
    Cause.SUPERSEDED: Reaction.GO_ON,
    Cause.GATE: Reaction.GO_ON,
    Cause.HALTED: Reaction.GO_ON,
    Cause.ROBOT_GONE: Reaction.GO_ON,
    Cause.STOPPED: Reaction.END,
    Cause.CONTROL_ENDED: Reaction.END,
    Cause.PAGE_LEFT: Reaction.DROP,
    Cause.LINK_LOST: Reaction.END,
    Cause.UNRECORDED: Reaction.END,
    Cause.BRIDGE_ENDED: Reaction.LEAVE,
}


class Ending(NamedTuple):
    """An event that may end tasks."""

    cause: Cause
    # its code is the outcome, unless a part has another word for the cause; its text the reason
    refusal: Refusal

    @property
    def of_unbegun(self) -> Refusal:
        """The answer to requests that have no goal on the robot: they end without a person's name."""
        return HALTED if self.cause in (Cause.STOPPED, Cause.CONTROL_ENDED, Cause.LINK_LOST) else self.refusal


class Activity(Enum):
    """An activity that a task may forbid while it is in progress."""

    DRIVE = "drive through the gate, which may limit the base to a crawl"
    NAVIGATE = "drive by the robot’s own navigation"
    MOVE_ARM = "move the arm, or a part that carries or ends it"
    TURN_HEAD = "turn the head"
    FORGET = "forget remembered obstacles"


class TaskRules(Protocol):
    """The core, as tasks use it."""

    lease: LeaseGuard
    watchdog_missing: bool  # nobody would stop a robot that drives itself if the bridge failed

    @property
    def sent(self) -> Velocity:
        """The last twist to the base."""

    def why_closed(self, now_s: float) -> Refusal | None:
        """Return why the robot takes no request from anybody: stopped, offline, or records cannot be written."""

    def why_not_begin(self, requester: Requester, now_s: float) -> Refusal | None:
        """Return why a requested task may not begin now: control lost, page gone, or the robot takes no request."""

    def why_not_still(self, now_s: float) -> Refusal | None:
        """Return a refusal if the base moves or is commanded to move."""

    def halt(self, code: str, reason: Sentence, now_s: float) -> None:
        """Send zero now and require neutral before the robot moves again."""

    def twist(self, velocity: Velocity, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """Take a velocity from a program of the holder. It passes the same rules as a stick position."""


P = TypeVar("P")


class Robot(Protocol):
    """The robot's parts, by what they do: each is an object of a class such as `motions.MotionPlayer`."""

    def part(self, kind: type[P]) -> P | None:
        """Return the part that does this; None: the robot has none, or is not connected yet."""


class Titles(Protocol):
    """The titles of motions, as pages show them."""

    def title_of(self, motion: str, action: str) -> str:
        """Return the title of an action's motion; its name, if no title is known."""


class Tasks(Protocol):
    """All tasks, as one part uses the others."""

    @property
    def capabilities(self) -> Titles:
        """The robot's capabilities."""

    def part(self, kind: type[P]) -> P:
        """Return the part of this class."""

    def blocks(self, activity: Activity, now_s: float, but: TaskPart | None = None) -> Refusal | None:
        """Return the first refusal of a part, `but` this one, whose task forbids this activity."""

    def topics_in_use(self, use: wire.Use, now_s: float) -> set[str]:
        """Return the topics of this use that tasks in progress need."""

    def read_motions(self) -> None:
        """Let the robot be asked for its motions."""


class Publisher(Protocol):
    """Sends messages of any type."""

    def check(self, order: wire.Publish, then: Callable[[Refusal | None, float], None]) -> None:
        """Check the fields against the type's definition; call `then` once, with a refusal or None, and the time."""

    def publish(self, order: wire.Publish) -> bool:
        """Send once, or at a rate instead of an earlier message on this topic. Return False if it is not sent."""

    def publish_stop(self, topic: str) -> None:
        """Stop sending on this topic."""

    def halt(self) -> None:
        """Drop all messages given so far: those sent at a rate, and those that wait for subscribers."""

    def keep_alive(self) -> None:
        """Allow sending at a rate to continue. Call it every tick: sending pauses without it."""


@dataclass(frozen=True)
class Context:
    """All that a part gets."""

    config: BridgeConfig
    robot: Robot
    gate: Gate
    records: Records
    rules: TaskRules
    tasks: Tasks
    publisher: Publisher
    left_goal: str = ""  # navigation's goal of an earlier bridge; the robot may still drive to it


class TaskPart(ABC):
    """The tasks of one kind, or of a few that belong together."""

    kinds: ClassVar[tuple[wire.TaskKind, ...]]  # descriptions of the requests that it takes
    reactions: ClassVar[Mapping[Cause, Reaction]]
    excludes: ClassVar[frozenset[Activity]] = frozenset()  # a task in progress forbids these
    # By the code of such a refusal: why the stick must return to neutral, if it was out meanwhile.
    neutral_words: ClassVar[Mapping[str, Sentence]] = {}
    no_task: ClassVar[Refusal | None] = None  # the answer to a cancel if no task is in progress
    last: Any = None  # how the last task ended, for pages

    def __init_subclass__(cls) -> None:
        """Check that a part with requests reacts to every cause, and can cancel. Raises `TypeError`."""
        super().__init_subclass__()
        kinds: tuple[wire.TaskKind, ...] = getattr(cls, "kinds", ())
        missing = set(Cause) - getattr(cls, "reactions", {}).keys() if kinds else ()
        if missing:
            names = ", ".join(sorted(cause.name for cause in missing))
            raise TypeError(f"{cls.__name__} has no reaction to {names}")
        can_cancel = cls.no_task is not None or cls.cancel_request is not TaskPart.cancel_request
        if any(kind.cancel for kind in kinds) and not can_cancel:
            raise TypeError(f"{cls.__name__} cannot cancel its tasks")

    def __init__(self, context: Context) -> None:
        self._context = context

    @abstractmethod
    def take(self, order: Any, grant: Grant, requester: Requester, now_s: float) -> None:
        """Check a request and record it. The requester is answered once, now or later."""

    def cancel_request(self, order: Any, why: str, now_s: float) -> Refusal | None:
        """Cancel the task that this request names. Return a refusal if there is none."""
        if not self.in_progress:
            return self.no_task
        self.tell(Ending(Cause.CANCELLED, Refusal("cancelled", why, "robot")), now_s)
        return None

    @property
    def in_progress(self) -> bool:
        """Return whether a task that can be cancelled is requested or runs."""
        return False

    def tell(self, ending: Ending, now_s: float) -> None:
        """React to what may end tasks."""
        reaction = self.reactions[ending.cause]
        if reaction in (Reaction.HALT, Reaction.END):  # first, so that a failed answer keeps nothing running
            self.end_running(ending, now_s)
        if reaction in (Reaction.DROP, Reaction.END, Reaction.LEAVE):
            self.drop(ending, now_s)
        if reaction is Reaction.LEAVE:
            self.leave(ending, now_s)

    @abstractmethod
    def drop(self, ending: Ending, now_s: float) -> None:
        """Refuse tasks that have not begun: answer their requesters and record it."""

    @abstractmethod
    def end_running(self, ending: Ending, now_s: float) -> None:
        """End tasks that run. A robot that must obey first is watched until it does."""

    def leave(self, ending: Ending, now_s: float) -> None:
        """End tasks that run and record their outcome now: nobody watches the robot any more."""
        self.end_running(ending, now_s)

    @abstractmethod
    def tick(self, now_s: float) -> None:
        """Begin what is recorded, if no rule forbids it now. Watch what runs."""

    @property
    def under_way(self) -> list[str]:
        """Tasks in progress that must not go on without records, in words."""
        return []

    def blocks(self, activity: Activity, now_s: float) -> Refusal | None:
        """Return a refusal while a task in progress forbids this activity, one of `excludes`."""
        return None

    def topics_in_use(self, use: wire.Use, now_s: float) -> set[str]:
        """Return the topics of this use that tasks in progress need."""
        return set()

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the fields of `wire.State` that pages and programs see of this kind."""
        return {}

    def headline(self, now_s: float) -> tuple[object, ...]:
        """Return what is reported at once when it changes."""
        return ()

    @property
    def ends(self) -> Iterable[ShowsEnd]:
        """The objects that show how a task ended."""
        return (self,)
