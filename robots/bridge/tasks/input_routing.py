"""Where input goes: for driving, speech and motions, the robot's default topic or a chosen one.

A chosen topic is on the admin's allow-list, has the default's type and a listener on the robot. A choice is recorded,
then connected, then valid. It ends with the control session, or when its listener goes; the end is recorded, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Protocol

from robots import wire
from robots.bridge.audit.records import RecordedTask, Records, Requester
from robots.bridge.config import BridgeConfig, Topic
from robots.wire import Refusal, Role, Use

NAMES: dict[Use, str] = {"drive": "driving", "speech": "speech", "motions": "motions"}
PARTING_S = 1.0  # zeros go to a chosen drive topic for at most so long after its holder's control
PATIENCE_S = 3.0  # what is not connected by then may be asked for anew


class InputSwitch(Protocol):
    """Connects to the robot's topics."""

    def attend(self, use: Use, topics: frozenset[str]) -> None:
        """Be connected to these topics of that use and no others. Returns at once; `InputRouting.attended` follows."""

    def drive_to(self, topic: str) -> None:
        """Velocities go to this one of the attended topics from now on."""

    def read_motions(self) -> None:
        """Ask the robot for its motions. Returns at once; `Catalogue.read` follows for each action."""


class RoutingRules(Protocol):
    """The rules and commands that routing needs: `Core`."""

    def why_not_begin(self, requester: Requester, now_s: float) -> Refusal | None:
        """Why what was asked for may not begin now: control is elsewhere, nobody is there, or the robot is closed."""

    def why_not_still(self, now_s: float) -> Refusal | None:
        """The base moves, or is told to."""

    def halt(self, code: str, reason: str, now_s: float) -> None:
        """Zero now, and a neutral stick before anything moves again."""


@dataclass(eq=False)
class _Route(RecordedTask):
    """A topic that was asked for, or chosen."""

    topic: str
    begun: bool = False  # it is on record, and being connected


class InputRouting:
    """The topics of one robot that take a holder's input, by use; an action's name where the type is an action's."""

    def __init__(
        self, config: BridgeConfig, switch: InputSwitch, records: Records, rules: RoutingRules
    ) -> None:
        topics = config.topics
        offered: dict[Use, Topic | None] = {
            "drive": topics.drive,
            "speech": topics.speech,
            "motions": topics.motions,
        }
        self.gone: dict[Use, wire.ChoiceEnd] = {}  # by use: what ended by itself, until the next choice
        self._made: dict[Use, _Route] = {}  # other than the default
        self._defaults = {use: topic for use, topic in offered.items() if topic is not None}
        self._switch = switch
        self._records = records
        self._rules = rules
        self._roles: dict[Use, dict[str, Role]] = {use: {} for use in self._defaults}
        for allowed in config.allowed:
            if allowed.what == "choose" and allowed.use in self._roles:
                self._roles[allowed.use][allowed.name] = allowed.role
        if "motions" in self._roles and topics.arm and topics.arm.postures:
            self._roles["motions"].clear()  # the default action's motions tell where the arm is, no other's
        self._listened: Mapping[str, str] | None = None
        self._asked: dict[Use, _Route] = {}
        self._always = {use: frozenset({topic.name}) for use, topic in self._defaults.items()}
        if "motions" in self._always:
            # A killed bridge may have left a motion running on this action: listen to it.
            self._always["motions"] |= self._roles["motions"].keys()
        self._wanted = dict(self._always)
        self._connected: dict[Use, Collection[str]] = dict(self._wanted)
        self._unanswered = Counter[Use]()  # of `InputSwitch.attend`, by use
        self._parted_s: float | None = None  # since then nobody answers for the chosen drive topic

    # --- where input goes -----------------------------------------------------------------------------

    def topic(self, use: Use) -> str:
        """Where input of this use goes now; KeyError if the robot has no such thing."""
        made = self._made.get(use)
        return made.topic if made else self._defaults[use].name

    @property
    def chosen(self) -> dict[Use, str]:
        """Where it goes, by use, if not to the default."""
        return {use: made.topic for use, made in self._made.items()}

    def connected(self, use: Use) -> Collection[str]:
        """The topics of this use that something can be sent to now."""
        return self._connected.get(use, ())

    @property
    def uses(self) -> dict[Use, wire.UseOffer]:
        """Topics to choose from, for pages; also uses without any listener."""
        return {
            use: wire.UseOffer(topic.name, topic.type, dict(self._roles[use]), self.refuse(use, None))
            for use, topic in self._defaults.items()
        }

    def refuse(self, use: Use, name: str | None) -> Refusal | None:
        """Why input of this use may not go to that topic (None: where it goes now). The web process judges roles."""
        default = self._defaults.get(use)
        if default is None:
            return Refusal(
                "not_offered", f"This robot has nothing that takes input for {NAMES[use]}.", "robot"
            )
        name = name or self.topic(use)
        if name not in {default.name, self.topic(use), *self._roles[use]}:
            text = f"Input for {NAMES[use]} may not go to {name}: the allow-list does not have it."
            return Refusal("not_allowed", text, "robot", {"use": use, "topic": name})
        return self._why_unheard(Topic(name, default.type))

    # --- choosing -------------------------------------------------------------------------------------

    def take(self, order: wire.Choose, requester: Requester, now_s: float) -> None:
        """Begin to choose. Its asker is answered once, when it is done or will not be."""
        use = order.use
        refusal = self.refuse(use, order.topic) if order.topic or use not in self._defaults else None
        refusal = refusal or self._why_not_now(use, requester, now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        self._withdraw(use, Refusal("overtaken", "Another topic was chosen meanwhile.", "robot"), now_s)
        name = order.topic or self._defaults[use].name
        if name == self.topic(use):
            requester.answer(None)
            return
        parameters = {"use": use, "from": self.topic(use), "to": name}
        number = self._records.request(requester.holder, "topic.choose", parameters, now_s)
        self._asked[use] = _Route(requester, number, now_s, name)

    def tick(self, busy: Mapping[Use, Collection[str]], now_s: float) -> None:
        """Go on with what is on record now. `busy`: topics where something is under way, by use."""
        for use, choice in list(self._asked.items()):
            if now_s - choice.since_s > PATIENCE_S:
                self._withdraw(use, _silent(choice), now_s)
            elif not choice.begun and choice.number.done():
                self._recorded(use, choice, now_s)
        if self._parted_s is not None:
            self._part(self._parted_s, now_s)
        for use in self._defaults:
            self._attend(use, busy.get(use, ()))
            self._settle(use, now_s)

    def attended(self, use: Use, topics: Collection[str] | None, now_s: float) -> None:
        """The robot is connected to by these topics now; by others, if something else was asked for since.

        None: that failed, and what was connected before and is still wanted is all there is.
        """
        self._unanswered[use] -= 1
        if not self._unanswered[use]:
            if topics is not None:
                self._connected[use] = topics
            self._settle(use, now_s)

    def surveyed(self, listened: Mapping[str, str], now_s: float) -> None:
        """Take the types of topics with a listener. A chosen topic without a listener is dropped."""
        self._listened = listened
        for use, made in list(self._made.items()):
            default = self._defaults[use]
            if self._why_unheard(Topic(made.topic, default.type)) is not None:
                why = f"{made.topic} is gone: input goes to {default.name} again"
                self.gone[use] = wire.ChoiceEnd(made.number.result(), made.topic, default.name, f"{why}.")
                self._go_back(use, "gone", why, now_s)

    def control_ended(self, reason: str, now_s: float) -> None:
        """The next holder begins with the defaults; a base that still rolls gets its zeros where it got its speed."""
        self.withdraw(Refusal("no_lease", reason, "lease"), now_s)
        for use in list(self._made):
            if use == "drive":
                self._parted_s = now_s
            else:
                self._go_back(use, "control_ended", reason, now_s)

    def withdraw(self, refusal: Refusal, now_s: float) -> None:
        """Withdraw choices that are not made yet."""
        for use in list(self._asked):
            self._withdraw(use, refusal, now_s)

    def close(self, refusal: Refusal, now_s: float) -> None:
        """The bridge ends, and the next one begins with the defaults."""
        self.withdraw(refusal, now_s)
        for use in list(self._made):
            self._end(use, "bridge_ended", now_s)

    # --- inside -----------------------------------------------------------------------------------------

    def _part(self, since_s: float, now_s: float) -> None:
        """Leave the chosen drive topic, once the base stands or had its zeros for long enough."""
        if self._rules.why_not_still(now_s) is None or now_s - since_s > PARTING_S:
            self._go_back("drive", "control_ended", "control ended", now_s)

    def _recorded(self, use: Use, choice: _Route, now_s: float) -> None:
        """Connect, unless something came in between."""
        refusal = choice.unrecorded or self._why_not_now(use, choice.requester, now_s)
        if refusal is None:
            choice.begun = True
        else:
            self._withdraw(use, refusal, now_s)

    def _settle(self, use: Use, now_s: float) -> None:
        """Make the choice that waited for its topic to be connected."""
        choice = self._asked.get(use)
        if choice is None or not choice.begun or choice.topic not in self._connected[use]:
            return
        del self._asked[use]
        refusal = self._why_not_now(use, choice.requester, now_s)
        if refusal is None:
            self._make(use, choice, f"input goes to {choice.topic} now", now_s)
        self._tell(use, choice, refusal, now_s)

    def _why_not_now(self, use: Use, requester: Requester, now_s: float) -> Refusal | None:
        refusal = self._rules.why_not_begin(requester, now_s)
        return refusal or (self._rules.why_not_still(now_s) if use == "drive" else None)

    def _make(self, use: Use, choice: _Route, why: str, now_s: float) -> None:
        """From now on input goes there."""
        self._send_to(use, choice.topic, why, now_s)
        self._made.pop(use, None)
        self.gone.pop(use, None)
        if choice.topic != self._defaults[use].name:
            self._made[use] = choice

    def _go_back(self, use: Use, outcome: str, why: str, now_s: float) -> None:
        """Input goes to the default again, though nobody asked for that."""
        self._send_to(use, self._defaults[use].name, why, now_s)
        self._end(use, outcome, now_s)

    def _end(self, use: Use, outcome: str, now_s: float) -> None:
        made = self._made.pop(use)
        parameters = {"use": use, "from": made.topic, "to": self._defaults[use].name}
        self._records.outcome(made, "topic.choose", outcome, parameters, now_s)

    def _send_to(self, use: Use, name: str, why: str, now_s: float) -> None:
        """A base gets its zero first, where it got its speed."""
        if use == "drive":
            self._parted_s = None
            self._rules.halt("input_moved", why, now_s)
            self._switch.drive_to(name)
        elif use == "motions":
            self._switch.read_motions()

    def _attend(self, use: Use, busy: Collection[str]) -> None:
        """Be connected where input goes or is about to go, and to every motion action; nowhere else."""
        asked = self._asked.get(use)
        begun = {asked.topic} if asked and asked.begun else set()
        wanted = self._always[use] | {self.topic(use), *busy, *begun}
        if wanted != self._wanted[use]:
            self._wanted[use] = wanted
            self._connected[use] = wanted & frozenset(self._connected[use])
            self._unanswered[use] += 1
            self._switch.attend(use, wanted)

    def _withdraw(self, use: Use, refusal: Refusal, now_s: float) -> None:
        if asked := self._asked.pop(use, None):
            self._tell(use, asked, refusal, now_s)

    def _tell(self, use: Use, choice: _Route, refusal: Refusal | None, now_s: float) -> None:
        """Answer, and put on record what came of it."""
        choice.requester.answer(refusal)
        outcome = refusal.code if refusal else "chosen"
        parameters = {"use": use, "to": choice.topic}
        self._records.outcome(choice, "topic.choose", outcome, parameters, now_s)

    def _why_unheard(self, topic: Topic) -> Refusal | None:
        """Nobody listens there, as far as the last survey of the robot's topics tells, or to another type."""
        if self._listened is None:
            return None
        heard = goal_topic(topic)
        found = self._listened.get(heard.name)
        if found == heard.type:
            return None
        figures = {"topic": topic.name, "type": topic.type}
        if found is None:
            return Refusal("no_listener", f"Nothing on the robot listens to {heard.name}.", "robot", figures)
        text = f"{heard.name} is {found} on the robot; needed is {heard.type}."
        return Refusal("wrong_type", text, "robot", {**figures, "found": found})


def _silent(choice: _Route) -> Refusal:
    text = f"{choice.topic} was not connected in time: ask again."
    return Refusal("robot_silent", text, "robot", {"topic": choice.topic, "limit_s": PATIENCE_S})


def goal_topic(topic: Topic) -> Topic:
    """The topic that takes the input itself: an action's goals, or the topic as it is."""
    if topic.type.endswith("Action"):
        return Topic(f"{topic.name}/goal", f"{topic.type}Goal")
    return topic
