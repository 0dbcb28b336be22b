"""Events of an invented lab, in the form in which the console and its bridges record them.

Permanent parameters, contents that may expire, and the actor are the same as in `robots.records.bridge_records`,
`teleop.control.services` and other writers; `tests/audit/test_invented_lab.py` checks some of them.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

from teleop.models import EndReason

RARE_WORD = "zanzibar"
RARE_OUTCOME = "bridge_killed"
RARE_REFUSAL = "robot_misdescribed"
SAID_WORDS = [
    *("hello", "welcome", "please", "follow", "thank", "you", "the", "laboratory", "good", "morning"),
    *("mañana", "buenos", "días", "你好", "欢迎", "机器人", "实验室", "مرحبا", "روبوت", "شكرا"),
    *(f"word{number}" for number in range(400)),
]
MOTIONS = ["wave", "head_tour", "home", "offer", "bow"]
PATHS = 200  # different paths
SAMPLES = (3, 60)  # least and most samples of a path
STEP_S = 0.5  # between two samples
FAST_MPS = 0.8


class Event(NamedTuple):
    """A record before it gets its number and time."""

    kind: str
    of: int | None = None  # distance to its request, in records of the same scene
    outcome: str = ""
    parameters: dict[str, Any] = {}
    text: str = ""
    private: dict[str, Any] = {}
    by_console: bool = False


class Scenes:
    """Each method draws one scene: records that belong together."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._paths = [self._path() for _ in range(PATHS)]
        self._in_session: dict[Callable[[], list[Event]], float] = {
            self._speech: 35,
            self._drive: 30,
            self._motion: 15,
            self._message: 5,
            self._refusal: 7,
            self._renewal: 5,
            self._stop: 3,
        }
        self._without_session: dict[Callable[[], list[Event]], float] = {
            self._camera: 60,
            self._change: 20,
            self._fault: 5,
            self._denial: 15,
        }

    def in_session(self) -> list[Event]:
        """Draw an action of the person who has control."""
        return self._one_of(self._in_session)

    def without_session(self) -> list[Event]:
        """Draw an event that needs no control session."""
        return self._one_of(self._without_session)

    def begin_session(self) -> list[Event]:
        return [Event("control.take")]

    def end_session(self, holder: str, name: str) -> list[Event]:
        """Draw the end of a control session."""
        reason = self._weighted(
            {EndReason.RELEASED: 70, EndReason.AWAY: 20, EndReason.TERM: 9, EndReason.RIGHT: 1}
        )
        facts, names = {"holder": holder}, {"holder_name": name}
        by_console = reason is not EndReason.RELEASED
        return [Event("control.end", None, reason.value, facts, private=names, by_console=by_console)]

    def sign_in(self) -> list[Event]:
        """Draw a person's sign-in and sign-out."""
        address = {"address": f"10.0.0.{self._chance.randrange(1, 255)}"}
        return [
            Event("account.sign_in", private=address | {"browser": "Mozilla/5.0 (X11) Firefox/140.0"}),
            Event("account.sign_out", private=address),
        ]

    # --- with control -----------------------------------------------------------------------------

    def _speech(self) -> list[Event]:
        words = self._chance.choices(SAID_WORDS, k=self._chance.randint(3, 10))
        if self._chance.random() < 0.00005:
            words.append(RARE_WORD)
        asked = {"language": "en-GB", "topic": "/tts"}
        outcome = self._weighted({"done": 95, "cancelled": 4, "failed": 1})
        return [
            Event("speech.start", parameters=asked, text=" ".join(words)),
            Event("speech.end", 1, outcome, self._lasted(10.0), private=_why(outcome, "done")),
        ]

    def _drive(self) -> list[Event]:
        path = self._chance.choice(self._paths)
        events = [Event("drive.start", private=_place(path[0]))]
        for _ in range(times := self._chance.choice([0, 0, 1, 1, 2, 4])):
            events += self._intervention(len(events), self._chance.choice(path))
        outcome = self._weighted({"standstill": 96, "halted": 2.5, "control_changed": 1.4, RARE_OUTCOME: 0.1})
        if outcome == RARE_OUTCOME:  # a killed bridge records no figures
            return [*events, Event("drive.end", len(events), outcome, by_console=True)]
        figures = {
            "distance_m": round(sum(math.dist(a[1:3], b[1:3]) for a, b in pairwise(path)), 3),
            "duration_s": round(path[-1][0] + self._chance.random(), 2),
            "top_mps": round(max(sample[4] for sample in path), 3),
            "top_radps": 0.4,
            "interventions": times,
        }
        where = {
            "words": outcome.replace("_", " "),
            "path": path,
            "path_tolerance_m": 0.05,
            **_place(path[-1]),
        }
        return [*events, Event("drive.end", len(events), outcome, figures, private=where)]

    def _intervention(self, of: int, sample: list[float]) -> list[Event]:
        code = self._weighted({"obstacle": 70, "near_miss": 25, "mover": 4, "scan_stale": 1})
        seen = {
            "sensor": "laser",
            "distance_m": round(self._chance.uniform(0.2, 1.5), 3),
            "bearing_rad": 0.1,
            "side": "ahead",
            "asked": {"vx_mps": 0.8, "vy_mps": 0, "w_radps": 0.1},
            "allowed": {"vx_mps": 0.2, "vy_mps": 0, "w_radps": 0.1},
        }
        words = {"words": f"slowed from 0.8 to 0.2 m/s: laser, {seen['distance_m']:.1f} m ahead"}
        pose = {"pose": sample[1:4]}
        return [
            Event("gate.begin", of, code, private={**words, "t_s": sample[0], **pose, **seen}),
            Event("gate.end", 1, private={**self._lasted(3.0), "also": [], "nearest": seen, **pose}),
        ]

    def _motion(self) -> list[Event]:
        motion = {"motion": self._chance.choice(MOTIONS)}
        outcome = self._weighted({"succeeded": 95, "cancelled": 4, "failed": 1})
        return [
            Event("motion.start", parameters={**motion, "topic": "/play_motion"}),
            Event("motion.end", 1, outcome, motion | self._lasted(6.0), private=_why(outcome, "succeeded")),
        ]

    def _message(self) -> list[Event]:
        asked = {"topic": "/note", "type": "std_msgs/String", "rate_hz": 0}
        fields = {"fields": '{"data":"note"}'}
        ended = {"topic": "/note", **self._lasted(1.0)}
        return [
            Event("publish.start", parameters=asked, private=fields),
            Event("publish.end", 1, "sent", ended),
        ]

    def _refusal(self) -> list[Event]:
        code = self._weighted({"robot_silent": 45, "speaking": 30, "motion_running": 24, RARE_REFUSAL: 1})
        return [_refused(code, rule="robot", of="say")]

    def _renewal(self) -> list[Event]:
        return [Event("control.renew", parameters={"term_s": 900})]

    def _stop(self) -> list[Event]:
        number = {"number": self._chance.randrange(1, 1000)}
        return [
            Event("stop.press", parameters={"through": "page"}),
            Event("stop.press", 1, "stopping"),
            Event("stop.latch", parameters=number, by_console=True),
            Event("stop.clear"),
            Event("stop.clear", 1, "clear"),
        ]

    # --- without ----------------------------------------------------------------------------------

    def _camera(self) -> list[Event]:
        return [
            Event("camera.start", parameters={"camera": "/xtion/rgb/image_raw"}),
            Event("camera.end", 1, "closed", self._lasted(600.0)),
        ]

    def _change(self) -> list[Event]:
        changes = [{"field": "max_share", "from": 1, "to": round(self._chance.random(), 2)}]
        return [Event("robot.change", parameters={"changes": changes})]

    def _fault(self) -> list[Event]:
        part, words = {"part": "bridge"}, {"words": "The robot has been away for more than 10 s."}
        return [
            Event("fault", None, "robot_away", part, private=words, by_console=True),
            Event("fault", 1, "over", part | self._lasted(600.0), by_console=True),
        ]

    def _denial(self) -> list[Event]:
        return [_refused(self._weighted({"role_too_low": 60, "held": 40}), rule="lease", of="control")]

    # --- chance -----------------------------------------------------------------------------------

    def _path(self) -> list[list[float]]:
        """Return t, x, y, yaw and speed of each sample."""
        x, y, yaw = 0.0, 0.0, 0.0
        path = []
        for number in range(self._chance.randint(*SAMPLES)):
            speed = self._chance.uniform(0.0, FAST_MPS)
            path.append([round(value, 3) for value in (STEP_S * number, x, y, yaw, speed)])
            yaw += self._chance.gauss(0.0, 0.2)
            x, y = x + STEP_S * speed * math.cos(yaw), y + STEP_S * speed * math.sin(yaw)
        return path

    def _lasted(self, most_s: float) -> dict[str, Any]:
        return {"duration_s": round(self._chance.uniform(0.1, most_s), 2)}

    def _weighted(self, weights: dict[Any, float]) -> Any:
        return self._chance.choices(list(weights), list(weights.values()))[0]

    def _one_of(self, scenes: dict[Callable[[], list[Event]], float]) -> list[Event]:
        return list(self._weighted(scenes)())


def _place(sample: list[float]) -> dict[str, Any]:
    return {"pose": sample[1:4], "map_to_odom": [1.5, -2.25, 0.5]}


def _why(outcome: str, good: str) -> dict[str, str]:
    """Return the reason in words of an outcome other than `good`."""
    return {} if outcome == good else {"words": f"The robot says: {outcome}."}


def _refused(code: str, *, rule: str, of: str) -> Event:
    facts = {"rule": rule, "of": of, "through": "page"}
    return Event("refusal", None, code, facts, private={"words": "Not done: ask the staff."})
