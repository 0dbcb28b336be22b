"""The tasks of one robot's holder: passes requests on to the part of their kind, and tells all parts what may end them.

Each task passes the same checks as a stick position (lease, stop, robot online), is recorded, and only then sent to the
robot. This module never blocks, and an ended task never begins again by itself.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from msgspec import structs

from robots.bridge.audit.records import Records, Reply, Requester
from robots.bridge.drive.drive_by import DrivesBy
from robots.bridge.gate.gate import Gate
from robots.bridge.limbs.limbs import Limbs
from robots.bridge.navigation.navigation_goals import NavigationGoals
from robots.bridge.tasks.capabilities import Capabilities
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.motions import MotionPlayer, Motions
from robots.bridge.tasks.named_ends import NamedEnds
from robots.bridge.tasks.parts import PARTS
from robots.bridge.tasks.publishing import Publications
from robots.bridge.tasks.speech import SpeechTasks
from robots.bridge.tasks.task import (
    Activity,
    Cause,
    Context,
    Ending,
    Publisher,
    Reaction,
    Robot,
    TaskPart,
    TaskRules,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.denylist import admissible
from robots.shared.records.record_sink import Holder
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Grant, Refusal

log = logging.getLogger(__name__)

LINK_PATIENCE_S = 2.0  # a motion continues this long without the page of its requester
_CANCELLED = say("Its holder cancelled it.")
_BRIDGE_ENDED = Ending(
    Cause.BRIDGE_ENDED,
    Refusal("bridge_ended", "It was not done: the robot’s bridge ended.", "robot"),
)
_PAGE_LEFT = Ending(
    Cause.PAGE_LEFT,
    Refusal("link_lost", "It was not done: the page that asked for it was left.", "lease"),
)
_LINK_LOST = Ending(
    Cause.LINK_LOST,
    Refusal(
        "link_lost",
        say("The requester’s page was not connected for {seconds:.0f} s.", seconds=LINK_PATIENCE_S),
        "lease",
    ),
)
_SUPERSEDED = Ending(
    Cause.SUPERSEDED, Refusal("replaced", "The holder’s own drive input took over.", "robot")
)
_UNKNOWN = Refusal("not_offered", "This bridge does not know the request. Reload the page.", "robot")
P = TypeVar("P")


class HolderTasks:
    """The tasks of one robot's holder."""

    def __init__(
        self,
        config: BridgeConfig,
        robot: Robot,
        gate: Gate,
        records: Records,
        rules: TaskRules,
        publisher: Publisher,
        announce: Callable[[wire.Offers], None],
        left_goal: str = "",
        kinds: Sequence[type[TaskPart]] = PARTS,
    ) -> None:
        """`left_goal`: navigation's goal of an earlier bridge; the robot may still drive to it."""
        config = structs.replace(config, allowed=admissible(config.allowed, config.topics))
        context = Context(config, robot, gate, records, rules, self, publisher, left_goal)
        self.parts = [kind(context) for kind in kinds]
        self._of_request = {
            request: part for part in self.parts for kind in part.kinds for request in kind.requests
        }
        # Looked up for each stick position
        self._excluding = {
            activity: [part for part in self.parts if activity in part.excludes] for activity in Activity
        }
        self._told = {
            cause: [part for part in self.parts if part.reactions[cause] is not Reaction.GO_ON]
            for cause in Cause
        }
        self._begins = {kind.request for part in self.parts for kind in part.kinds}
        self._rules = rules
        self._robot = robot
        self._named = NamedEnds()
        # The parts with which core and robot speak by name.
        self.motions = self.part(Motions)
        self.speech = self.part(SpeechTasks)
        self.routing = self.part(InputRouting)
        self.publications = self.part(Publications)
        self.drives_by = self.part(DrivesBy)
        self.navigation = self.part(NavigationGoals)
        self.limbs = self.part(Limbs)
        self.capabilities = Capabilities(config, self.routing, announce)

    def part(self, kind: type[P]) -> P:
        """Return the part of this class."""
        return next(part for part in self.parts if isinstance(part, kind))

    # --- requests ---------------------------------------------------------------------------------

    def take(self, order: wire.TaskRequest, link: int, now_s: float, answer: Reply) -> None:
        """Begin or cancel a task. `answer` is called once, now or later: with a refusal, or None."""
        refusal = self._rules.lease.refuse_command(order.fence or 0, link, now_s)
        grant = self._rules.lease.current
        if refusal is not None or grant is None:
            answer(refusal)
            return
        part = self._of_request.get(type(order))
        if part is None:
            answer(_UNKNOWN)
        elif type(order) in self._begins:
            part.take(order, grant, Requester(holder_of(grant), link, answer), now_s)
        else:
            answer(part.cancel_request(order, _CANCELLED, now_s))

    def cancel(self, what: str, by: str, now_s: float) -> Refusal | None:
        """Cancel a task for a person who need not have control; the web process has checked the right.

        `what`: the name of a kind that others may cancel.
        """
        why = self._named.words(say("Cancelled by {by}.", by=by), say("Another person cancelled it."))
        for part in self.parts:
            if any(kind.name == what and kind.cancelled_by_others for kind in part.kinds):
                return part.cancel_request(None, why, now_s)
        return _UNKNOWN

    def refresh(self) -> None:
        """Read the robot's capabilities again and report them."""
        if "motions" in self.routing.uses:
            self.capabilities.request_report()
            self.read_motions()
        else:
            self.capabilities.report(anyway=True)

    def read_motions(self) -> None:
        """Let the robot be asked for its motions."""
        player = self._robot.part(MotionPlayer)
        if player is not None:
            player.read_motions()
        else:
            text = say("The robot’s ROS has not answered yet.")
            self.capabilities.read(self.routing.topic("motions"), [], text)

    def blocks(self, activity: Activity, now_s: float, but: TaskPart | None = None) -> Refusal | None:
        """Return the first refusal of a part, `but` this one, whose task forbids this activity."""
        refusals = (part.blocks(activity, now_s) for part in self._excluding[activity] if part is not but)
        return next((refusal for refusal in refusals if refusal is not None), None)

    def topics_in_use(self, use: wire.Use, now_s: float) -> set[str]:
        """Return the topics of this use that tasks in progress need."""
        return set().union(*(part.topics_in_use(use, now_s) for part in self.parts))

    @property
    def under_way(self) -> list[str]:
        """Tasks in progress, in words. A text being spoken is not included: it ends by itself."""
        return [words for part in self.parts for words in part.under_way]

    @property
    def neutral_words(self) -> dict[str, Sentence]:
        """Return why the stick must return to neutral, by the code of the refusal of a task in progress."""
        return {code: words for part in self.parts for code, words in part.neutral_words.items()}

    # --- for pages --------------------------------------------------------------------------------

    def state(self, now_s: float) -> dict[str, Any]:
        """Return the fields of `wire.State` about tasks."""
        return {name: value for part in self.parts for name, value in part.state(now_s).items()}

    def headline(self, now_s: float) -> tuple[object, ...]:
        """Return the part of the state whose changes are reported at once."""
        return tuple(part.headline(now_s) for part in self.parts)

    # --- events -----------------------------------------------------------------------------------

    def tick(self, page_gone_s: float | None, now_s: float) -> None:
        """Send recorded tasks to the robot; cancel tasks that must not continue.

        `page_gone_s`: when the holder's page was lost; None while it is there.
        """
        if page_gone_s is not None and now_s - page_gone_s > LINK_PATIENCE_S:
            self._tell(_LINK_LOST, now_s)
        for part in self.parts:
            part.tick(now_s)
        self.capabilities.report()
        self._named.tick((shown for part in self.parts for shown in part.ends), now_s)

    def superseded(self, now_s: float) -> None:
        """End drives by tasks: the holder's own drive input took over. Called for each stick position."""
        if any(part.in_progress for part in self._told[Cause.SUPERSEDED]):
            self._tell(_SUPERSEDED, now_s)

    def held_back(self, code: str, text: str, now_s: float) -> None:
        """End drives by tasks: the gate's verdict forbids them."""
        self._tell(Ending(Cause.GATE, Refusal(code, text, "gate")), now_s)

    def halted(self, code: str, reason: Sentence, now_s: float) -> None:
        """End drives by tasks that run: the base was halted. Others are checked again when they are due."""
        cause = Cause.ROBOT_GONE if code == "robot_offline" else Cause.HALTED
        self._tell(Ending(cause, Refusal(code, reason, "robot")), now_s)

    def stopped(self, by: str, now_s: float) -> None:
        """End tasks: stop was pressed."""
        why = self._named.words(say("The robot was stopped by {by}.", by=by), say("The robot was stopped."))
        self._tell(Ending(Cause.STOPPED, Refusal("stopped", why, "stop")), now_s)

    def unrecorded(self, refusal: Refusal, now_s: float) -> None:
        """End tasks: records cannot be written. A text being spoken is spoken to its end."""
        self._tell(Ending(Cause.UNRECORDED, refusal), now_s)

    def page_left(self, now_s: float) -> None:
        """Drop tasks that have not begun: their page is gone. `tick` ends those that run."""
        self._tell(_PAGE_LEFT, now_s)

    def control_ended(self, reason: Sentence, now_s: float) -> None:
        """Cancel running tasks: their owner lost control. A text being spoken is spoken to its end."""
        self._named.words(reason, say("Its holder’s control ended."))
        self._tell(Ending(Cause.CONTROL_ENDED, Refusal("control_ended", reason, "lease")), now_s)

    def close(self, now_s: float) -> None:
        """End all tasks: the bridge ends."""
        self._tell(_BRIDGE_ENDED, now_s)

    def _tell(self, ending: Ending, now_s: float) -> None:
        """Tell all parts that it may concern, also if one of them fails. Raises the first error at the end."""
        failed: Exception | None = None
        for part in self._told[ending.cause]:
            try:
                part.tell(ending, now_s)
            except Exception as error:
                log.exception("%s was not told: %s", type(part).__name__, ending.cause.name)
                failed = failed or error
        if failed is not None:
            raise failed


def holder_of(grant: Grant) -> Holder:
    """Return the person who is responsible for tasks under this grant."""
    return Holder(grant.holder_id, grant.holder, grant.session, grant.fence)
