"""Recorded motions over play_motion's action: their list, and goals with our own ids."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

from msgspec import structs

from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.ros.bounds.mailboxes import Mailboxes
from robots.bridge.ros.inspector import services
from robots.bridge.ros.inspector.declined import Declined
from robots.bridge.ros.tasks.actions import EVENTS_WAIT, ActionTopics, GoalListener
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.motions import Motions, offered, recorded
from robots.shared.configuration.bridge_config import Topic
from robots.shared.messages.packing import Detail
from robots.shared.ros.master import Master, MasterError
from robots.shared.ros.message_types.classes import message_class
from robots.shared.ros.texts import MOST_MOTIONS, PARAGRAPH, SENTENCE, TITLE, cut
from robots.shared.sentences import joined, say
from robots.shared.wire import MotionOffer

WHOLE = Detail(whole=10_000, first=10_000, text=1000)  # motions, and characters of a name
LARGEST_LIST = 1024 * 1024  # bytes of the list of motions
ERRORS = {  # PlayMotionResult's codes in words
    "MOTION_NOT_FOUND": say("the robot does not know this motion"),
    "CONTROLLER_BUSY": say("something else moves these joints"),
    "MISSING_CONTROLLER": say("the controller of these joints does not run"),
    "TRAJECTORY_ERROR": say("the controller does not take this motion"),
    "GOAL_NOT_REACHED": say("the joints did not get to where they should"),
    "PLANNER_OFFLINE": say("the robot’s motion planner does not run"),
    "NO_PLAN_FOUND": say("the robot found no way to its first posture without a collision"),
    "OTHER_ERROR": say("the robot does not say why"),
}


class MotionTopics(GoalListener):
    """The motion actions of one robot: the default, and those that people may choose instead, of one type.

    Changes of goals are reported to `tasks` through `mail`, on the event loop. `joined` is called whenever a
    motion server connects: it may have other motions than before.
    """

    def __init__(
        self,
        names: Collection[str],
        type: str,
        master: Master,
        mail: Mailboxes,
        tasks: Motions,
        joined: Callable[[], None],
    ) -> None:
        self._master = master
        self._mail = mail
        self._tasks = tasks
        self._errors = _errors(message_class(f"{type.removesuffix('Action')}Result"))
        self.repertoire: dict[str, Mapping[str, Motion | None]] = {}  # by action; None: points unknown
        # By action: motions, and why there are none.
        self._offers: dict[str, tuple[list[MotionOffer], str]] = {}
        self._actions = {name: ActionTopics(Topic(name, type), self, joined=joined) for name in names}

    def close(self) -> None:
        """Unregister from the topics of all actions."""
        for action in self._actions.values():
            action.close()

    def read(self, tell: Callable[[str, list[MotionOffer], str], None]) -> None:
        """Read the robot's motions: names from its service, the rest from its parameters.

        `tell` gets the motions of each action, or the reason why there are none.
        """
        for action in self._actions:
            try:
                parameters, listed = self._parameters(action), self._listed(f"{action}/list_motions")
            except MasterError as error:  # the known motions stay
                self._offers.setdefault(action, ([], error.args[0]))
            else:
                self.repertoire[action] = recorded(parameters, listed)
                offers = offered(parameters, listed)
                words = "" if offers else say("{action} offers no motions.", action=action)
                if len(offers) > MOST_MOTIONS:
                    words = say(
                        "{action} offers {count} motions; {most} are shown.",
                        action=action,
                        count=len(offers),
                        most=MOST_MOTIONS,
                    )
                self._offers[action] = [_cut(offer) for offer in offers[:MOST_MOTIONS]], words
            tell(action, *self._offers[action])

    def look_up(self, action: str, motion: str) -> tuple[Motion | None, bool]:
        """Return the robot's present motion (None: points unknown), and whether it differs from the last `read`.

        One call to the master. KeyError if there is no such motion, MasterError if the master does not answer.
        """
        now = recorded({motion: self._parameters(action, motion)})[motion]
        read = self.repertoire.get(action, {})
        if now is None and motion not in read:
            raise KeyError(motion)
        return now, motion not in read or read[motion] != now

    def play(self, goal_id: str, motion: str, action: str) -> None:
        """Send the goal. Planning is never skipped."""
        topics = self._actions[action]
        goal = topics.goal_class()
        goal.goal_id.id = goal_id
        goal.goal.motion_name = motion
        topics.send(goal)

    def cancel(self, goal_id: str, action: str) -> None:
        """Cancel this goal and no other."""
        self._actions[action].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        """For the emergency stop: each cancels all goals of one action, from any sender."""
        return [action.cancel_all for action in self._actions.values()]

    def _parameters(self, action: str, motion: str = "") -> Any:
        """Return the parameters of an action's motions, or of one motion."""
        return self._master.parameter(f"{action}/motions/{motion}".rstrip("/"))

    def _listed(self, service: str) -> dict[str, float] | None:
        """Return names and durations (s) of the motions that the service lists; None without an answer."""
        try:
            found = services.find(self._master, service)
            if found.type != "play_motion_msgs/ListMotions":
                return None
            answer, _ = services.call(found, {}, lambda: None, WHOLE, LARGEST_LIST)
        except (Declined, ValueError):
            return None
        return {
            info["name"]: info["duration"]["secs"] + info["duration"]["nsecs"] / 1e9
            for info in answer["motions"]
        }

    # --- on rospy's threads (actions.GoalListener) ----------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._mail.post(
            ("motions", action), lambda: self._tasks.running(action, goals.keys(), time.monotonic())
        )

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Report the end of one of our goals, with the robot's text and its error code in words."""
        if not goal_id.startswith(OURS):  # other senders' goals matter only while they run
            return
        sentences = [self._code_words(result.error_code), cut(result.error_string, SENTENCE) or text]
        if outcome in {"succeeded", "cancelled"}:
            sentences = sentences[1:]
        words = cut(_sentence([part for part in sentences if part]), SENTENCE)
        self._mail.post(
            "motions ended", lambda: self._tasks.ended(goal_id, outcome, words, time.monotonic()), EVENTS_WAIT
        )

    def _code_words(self, code: int) -> str:
        """Return the words of an error code; unknown codes keep their number."""
        return self._errors.get(code) or (say("error code {code}", code=code) if code else "")


def _errors(result: type[Any]) -> dict[int, str]:
    return {getattr(result, name): words for name, words in ERRORS.items()}


def _cut(offer: MotionOffer) -> MotionOffer:
    """Cut the texts for the page. A motion whose name was cut cannot be played."""
    return structs.replace(
        offer,
        name=cut(offer.name, TITLE),
        title=cut(offer.title, TITLE),
        usage=cut(offer.usage, TITLE),
        description=cut(offer.description, PARAGRAPH),
    )


def _sentence(parts: list[str]) -> str:
    return say("{text:capital}", text=joined(": ", parts)) if parts else ""
