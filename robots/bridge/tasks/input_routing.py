"""Route a holder's input (driving, speech, motions): to the robot's default topic, or to a chosen one.

Software of other versions may have another name or type in place of a default topic (`Topic.others`): if only one of
them is there, input goes to it. A topic may be chosen if it is on the admin's allow-list, it has the type of the
default topic, and a node on the robot subscribes to it. A choice is recorded, then connected, then made. It ends with
its holder's control, or when the subscriber is gone; the end is recorded as well.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from msgspec import structs

from robots.bridge.audit.records import RecordedTask, Requester
from robots.bridge.tasks.task import Cause, Context, Ending, Reaction, TaskPart
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Grant, Refusal, Role, Use

NAMES: dict[Use, str] = {"drive": say("driving"), "speech": say("speech"), "motions": say("motions")}
PARTING_S = 1.0  # when its holder's control has ended, a chosen drive topic gets zeros for at most this time
PATIENCE_S = 3.0  # time limit for connecting; then the person may ask again


class InputSwitch(ABC):
    """Connects to the robot's topics."""

    @abstractmethod
    def attend(self, use: Use, topics: frozenset[str]) -> None:
        """Connect to exactly these topics of the use. Returns at once; `InputRouting.attended` follows."""

    @abstractmethod
    def drive_to(self, topic: str) -> None:
        """Publish velocities on this topic from now on. It is one of the connected topics."""


@dataclass(eq=False)
class _Route(RecordedTask):
    """A topic that is requested or chosen."""

    topic: str
    begun: bool = False  # recorded, and being connected


class InputRouting(TaskPart):
    """The topics of one robot that take a holder's input, by use. For an action, its name is the topic."""

    kinds = (wire.CHOOSE,)
    reactions = {
        Cause.CANCELLED: Reaction.GO_ON,
        Cause.SUPERSEDED: Reaction.GO_ON,
        Cause.GATE: Reaction.GO_ON,
        Cause.HALTED: Reaction.GO_ON,
        Cause.ROBOT_GONE: Reaction.GO_ON,
        Cause.STOPPED: Reaction.GO_ON,
        Cause.CONTROL_ENDED: Reaction.END,
        Cause.PAGE_LEFT: Reaction.DROP,
        Cause.LINK_LOST: Reaction.GO_ON,
        Cause.UNRECORDED: Reaction.DROP,
        Cause.BRIDGE_ENDED: Reaction.LEAVE,
    }

    def __init__(self, context: Context) -> None:
        config, topics = context.config, context.config.topics
        offered: dict[Use, Topic | None] = {
            "drive": topics.drive,
            "speech": topics.speech,
            "motions": topics.motions,
        }
        # by use: choices that ended by themselves, until the next choice
        self.gone: dict[Use, wire.ChoiceEnd] = {}
        self._made: dict[Use, _Route] = {}  # choices other than the default
        self._entered = {use: topic for use, topic in offered.items() if topic is not None}
        self._defaults = dict(self._entered)  # the same as the robot has them
        self._robot = context.robot
        self._tasks = context.tasks
        self._records = context.records
        self._rules = context.rules
        self._roles: dict[Use, dict[str, Role]] = {use: {} for use in self._defaults}
        for allowed in config.allowed:
            if allowed.what == "choose" and allowed.use in self._roles:
                self._roles[allowed.use][allowed.name] = allowed.role
        if "motions" in self._roles and topics.arm and topics.arm.postures:
            self._roles["motions"].clear()  # the arm's posture is known only for the default action's motions
        self._listened: Mapping[str, str] | None = None
        self._asked: dict[Use, _Route] = {}
        self._always = {use: frozenset({topic.name}) for use, topic in self._defaults.items()}
        if "motions" in self._always:
            # Subscribe to all motion actions: a motion that an earlier bridge started may still run.
            self._always["motions"] |= self._roles["motions"].keys()
        self._wanted = dict(self._always)
        self._connected: dict[Use, Collection[str]] = dict(self._wanted)
        self._unanswered = Counter[Use]()  # calls of `InputSwitch.attend`, by use
        self._parted_s: float | None = None  # since when the chosen drive topic has no holder

    # --- where input goes -----------------------------------------------------------------------------

    def topic(self, use: Use) -> str:
        """Return the topic of this use; KeyError if the robot has none."""
        made = self._made.get(use)
        return made.topic if made else self._defaults[use].name

    def type(self, use: Use) -> str:
        """Return the type of this topic; KeyError if the robot has none."""
        return self._typed(use, self.topic(use)).type

    @property
    def chosen(self) -> dict[Use, str]:
        """Return the chosen topics, by use, without the defaults."""
        return {use: made.topic for use, made in self._made.items()}

    def connected(self, use: Use) -> Collection[str]:
        """Return the topics of this use that are connected now."""
        return self._connected.get(use, ())

    @property
    def uses(self) -> dict[Use, wire.UseOffer]:
        """Return the topics to choose from, for pages, and which of them have no subscriber."""
        return {
            use: wire.UseOffer(topic.name, topic.type, dict(self._roles[use]), self.refuse(use, None))
            for use, topic in self._defaults.items()
        }

    def refuse(self, use: Use, name: str | None) -> Refusal | None:
        """Return why input of this use may not go to that topic (None: the present one).

        The web process checks roles.
        """
        default = self._defaults.get(use)
        if default is None:
            return Refusal(
                "not_offered", say("This robot takes no input for {use}.", use=NAMES[use]), "robot"
            )
        name = name or self.topic(use)
        if name not in {default.name, self.topic(use), *self._roles[use]}:
            text = say(
                "Input for {use} may not go to {name}: it is not on the allow-list.",
                use=NAMES[use],
                name=name,
            )
            return Refusal("not_allowed", text, "robot", {"use": use, "topic": name})
        return self._why_no_listener(use, name)

    # --- choosing -------------------------------------------------------------------------------------

    def take(self, order: wire.Choose, grant: Grant, requester: Requester, now_s: float) -> None:
        """Begin to choose a topic. The requester is answered once, when the choice is made or refused."""
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
        number = self._records.request(requester.holder, wire.CHOOSE.record, parameters, now_s)
        self._asked[use] = _Route(requester, number, now_s, name)

    def tick(self, now_s: float) -> None:
        for use, choice in list(self._asked.items()):
            if now_s - choice.since_s > PATIENCE_S:
                self._withdraw(use, _silent(choice), now_s)
            elif not choice.begun and choice.number.done():
                self._recorded(use, choice, now_s)
        if self._parted_s is not None:
            self._part(self._parted_s, now_s)
        for use in self._defaults:
            self._attend(use, self._tasks.topics_in_use(use, now_s))
            self._settle(use, now_s)

    def attended(self, use: Use, topics: Collection[str] | None, now_s: float) -> None:
        """Take the report that these topics are connected. Ignore it if a newer `attend` has no report yet.

        None: the attempt failed; earlier connections that are still needed remain.
        """
        self._unanswered[use] -= 1
        if not self._unanswered[use]:
            if topics is not None:
                self._connected[use] = topics
            self._settle(use, now_s)

    def surveyed(self, listened: Mapping[str, str], now_s: float) -> None:
        """Take the topics that nodes on the robot subscribe to, with types. End choices whose subscriber is gone."""
        self._listened = listened
        for use, entered in self._entered.items():
            there = found(entered, listened)
            self._defaults[use] = there[0] if len(there) == 1 else entered
            if use != "motions":
                self._always[use] = frozenset({self._defaults[use].name})
        for use, made in list(self._made.items()):
            default = self._defaults[use]
            if self._why_no_listener(use, made.topic) is not None:
                why = say(
                    "{topic} has no subscriber any more: input goes to {default} again.",
                    topic=made.topic,
                    default=default.name,
                )
                self.gone[use] = wire.ChoiceEnd(made.number.result(), made.topic, default.name, why)
                self._go_back(use, "gone", why, now_s)

    def drop(self, ending: Ending, now_s: float) -> None:
        refusal = ending.refusal
        if ending.cause is Cause.CONTROL_ENDED:
            refusal = structs.replace(refusal, code="no_lease")
        for use in list(self._asked):
            self._withdraw(use, refusal, now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        """Return to the defaults for the next holder.

        A base that still rolls first gets zeros on the topic by which it was driven.
        """
        for use in list(self._made):
            if use == "drive":
                self._parted_s = now_s
            else:
                self._go_back(use, ending.refusal.code, ending.refusal.sentence, now_s)

    def leave(self, ending: Ending, now_s: float) -> None:
        """Drop all choices: the bridge ends, and the next bridge begins with the defaults."""
        for use in list(self._made):
            self._end(use, ending.refusal.code, now_s)

    def state(self, now_s: float) -> dict[str, Any]:
        return {"chosen": self.chosen, "choice_ended": dict(self.gone)}

    def headline(self, now_s: float) -> tuple[object, ...]:
        return (self.chosen, dict(self.gone))

    # --- inside -----------------------------------------------------------------------------------------

    def _part(self, since_s: float, now_s: float) -> None:
        """Leave the chosen drive topic when the base stands, or after the time limit for zeros."""
        if self._rules.why_not_still(now_s) is None or now_s - since_s > PARTING_S:
            self._go_back("drive", "control_ended", say("control ended"), now_s)

    def _recorded(self, use: Use, choice: _Route, now_s: float) -> None:
        """Connect a recorded choice, unless a rule now forbids it."""
        refusal = choice.unrecorded or self._why_not_now(use, choice.requester, now_s)
        if refusal is None:
            choice.begun = True
        else:
            self._withdraw(use, refusal, now_s)

    def _settle(self, use: Use, now_s: float) -> None:
        """Make a choice whose topic is connected."""
        choice = self._asked.get(use)
        if choice is None or not choice.begun or choice.topic not in self._connected[use]:
            return
        del self._asked[use]
        refusal = self._why_not_now(use, choice.requester, now_s)
        if refusal is None:
            self._make(use, choice, say("input goes to {topic} now", topic=choice.topic), now_s)
        self._answer(use, choice, refusal, now_s)

    def _why_not_now(self, use: Use, requester: Requester, now_s: float) -> Refusal | None:
        refusal = self._rules.why_not_begin(requester, now_s)
        return refusal or (self._rules.why_not_still(now_s) if use == "drive" else None)

    def _make(self, use: Use, choice: _Route, why: Sentence, now_s: float) -> None:
        """Route input to the choice from now on."""
        self._send_to(use, choice.topic, why, now_s)
        self._made.pop(use, None)
        self.gone.pop(use, None)
        if choice.topic != self._defaults[use].name:
            self._made[use] = choice

    def _go_back(self, use: Use, outcome: str, why: Sentence, now_s: float) -> None:
        """Return to the default although nobody asked for it."""
        self._send_to(use, self._defaults[use].name, why, now_s)
        self._end(use, outcome, now_s)

    def _end(self, use: Use, outcome: str, now_s: float) -> None:
        made = self._made.pop(use)
        parameters = {"use": use, "from": made.topic, "to": self._defaults[use].name}
        self._records.outcome(made, wire.CHOOSE.outcome, outcome, parameters, now_s)

    def _send_to(self, use: Use, name: str, why: Sentence, now_s: float) -> None:
        """Route input to `name`; a base gets its zero on the old topic first."""
        if use == "drive":
            self._parted_s = None
            self._rules.halt("input_moved", why, now_s)
            if switch := self._robot.part(InputSwitch):
                switch.drive_to(name)
        elif use == "motions":
            self._tasks.read_motions()

    def _attend(self, use: Use, busy: Collection[str]) -> None:
        """Connect the topics that take input now or soon, and all motion actions."""
        asked = self._asked.get(use)
        begun = {asked.topic} if asked and asked.begun else set()
        wanted = self._always[use] | {self.topic(use), *busy, *begun}
        if wanted != self._wanted[use]:
            self._wanted[use] = wanted
            self._connected[use] = wanted & frozenset(self._connected[use])
            if switch := self._robot.part(InputSwitch):
                self._unanswered[use] += 1
                switch.attend(use, wanted)

    def _withdraw(self, use: Use, refusal: Refusal, now_s: float) -> None:
        if asked := self._asked.pop(use, None):
            self._answer(use, asked, refusal, now_s)

    def _answer(self, use: Use, choice: _Route, refusal: Refusal | None, now_s: float) -> None:
        """Answer the requester and record the result."""
        choice.requester.answer(refusal)
        outcome = refusal.code if refusal else "chosen"
        parameters = {"use": use, "to": choice.topic}
        self._records.outcome(choice, wire.CHOOSE.outcome, outcome, parameters, now_s)

    def _typed(self, use: Use, name: str) -> Topic:
        """Return a topic of this use with its type: a chosen one has the type that was entered for the default."""
        default = self._defaults[use]
        if name == default.name:
            return default
        return Topic(name, default.type if use == "drive" else self._entered[use].type)

    def _why_no_listener(self, use: Use, name: str) -> Refusal | None:
        """Return a refusal if, by the last survey, no node subscribes to the topic with its type."""
        if self._listened is None:
            return None
        topic, entered = self._typed(use, name), self._entered[use]
        heard = goal_topic(topic)
        known = self._listened.get(heard.name)
        if known == heard.type:
            return None
        figures = {"topic": topic.name, "type": topic.type}
        if known is None:
            text = say("No node on the robot subscribes to {name}.", name=heard.name)
            if name == entered.name and len(rivals := found(entered, self._listened)) > 1:
                text = say(
                    "The robot has no {name}, but {others}: enter one of them in its profile.",
                    name=name,
                    others=", ".join(one.name for one in rivals),
                )
            return Refusal("no_listener", text, "robot", figures)
        text = say(
            "{name} has type {found} on the robot, but {type} is needed.",
            name=heard.name,
            found=known,
            type=heard.type,
        )
        return Refusal("wrong_type", text, "robot", {**figures, "found": known})


def _silent(choice: _Route) -> Refusal:
    text = say("{topic} was not connected in time: ask again.", topic=choice.topic)
    return Refusal("robot_silent", text, "robot", {"topic": choice.topic, "limit_s": PATIENCE_S})


def found(topic: Topic, listened: Mapping[str, str]) -> list[Topic]:
    """Return the topic if nodes on the robot subscribe to it; else all its others to which they do."""
    there = [
        one for one in (topic, *topic.others) if listened.get((heard := goal_topic(one)).name) == heard.type
    ]
    return [topic] if topic in there else there


def goal_topic(topic: Topic) -> Topic:
    """Return the topic that takes the input: an action's goal topic, or the topic itself."""
    if topic.is_action:
        return Topic(f"{topic.name}/goal", f"{topic.type}Goal")
    return topic
