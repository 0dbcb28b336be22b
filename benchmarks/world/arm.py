"""A moving arm in the sensors' view, and its posture as the bridge calculates it from an incomplete description."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

from benchmarks.world.controllers import GateController
from benchmarks.world.robot import tiago_arm
from robots.bridge.arm.clearance import ArmClearance, ArmModel
from robots.bridge.arm.posture import ArmPosture
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.arm.sweep import Motion
from robots.shared.wire import Refusal
from robots.simulator.joints.arm import SEGMENTS
from robots.simulator.joints.frames import urdf
from robots.simulator.joints.motions import Phase, Run
from robots.simulator.robot import Robot
from robots.simulator.sensors.body import TIAGO

REPORTED_EVERY_S = 0.1
WATCHED_EVERY_S = 0.05  # as the bridge does
SEEN_GROUP = 0  # of MuJoCo's geometries: rays hit it
PATIENCE_S = 10.0  # refused for so long, the motions are given up


@dataclass(frozen=True)
class ArmShow:
    """Motions in order, and the number of links at the arm's tip that the robot's description lacks."""

    motions: tuple[str, ...]
    lacks: int


class MovingArm(ArmModel):
    """Plays motions while the bridge's rule finds room for the arm, and reports the posture to the gate.

    A motion whose room is lost is cancelled and started again, like by a person who tries again.
    """

    def __init__(self, robot: Robot, controller: GateController, show: ArmShow) -> None:
        self._robot = robot
        self._controller = controller
        self._left = list(show.motions)
        self._run: Run | None = None
        self._name = ""
        self._space: tuple[Disc, ...] = ()  # swept by the run
        self._reported_s = -REPORTED_EVERY_S
        self._watched_s = -WATCHED_EVERY_S
        self._now_s = 0.0
        # Seconds in which a motion was refused, or cancelled because the arm had no room
        self.refused_s = 0.0
        self.posture = ArmPosture(tiago_arm())
        self.posture.describe(_described(show.lacks))
        self.posture.awaits_description = False  # as the node notes when the master has answered
        self._clearance = ArmClearance(controller.gate, lambda: self)
        physics = robot.physics.model
        for segment in SEGMENTS:
            physics.geom(f"robot {segment.name}").group = SEEN_GROUP

    def arm(self) -> tuple[Disc, ...] | None:
        return self.posture.arm(self._now_s)

    def arm_problem(self) -> str:
        return self.posture.problem(self._now_s)

    @property
    def is_done(self) -> bool:
        """Return whether all motions ended."""
        return not self._left and (self._run is None or self._run.phase is not Phase.MOVING)

    def tick(self, now_s: float) -> None:
        """Report the posture (10 Hz), and check the run or start the next motion (20 Hz)."""
        self._now_s = now_s
        if now_s - self._reported_s >= REPORTED_EVERY_S:
            self._reported_s = now_s
            self.posture.update(self._robot.player.positions.items(), now_s)
            self._controller.posture = self.posture.posture(now_s)
        if now_s - self._watched_s >= WATCHED_EVERY_S:
            self._watched_s = now_s
            if self._run and self._run.phase is Phase.MOVING:
                self._watch(self._run)
            elif self._left:
                self._begin(self._left[0])

    def _watch(self, run: Run) -> None:
        if refusal := self._clearance.refuse(self._space, self._now_s, running=True):
            self._robot.player.cancel(run)
            self._left.insert(0, self._name)
            self._refused(refusal)

    def _begin(self, name: str) -> None:
        points = self._robot.player.motions[name]
        motion = Motion(tuple(points.joints), tuple(tuple(point.positions) for point in points.points))
        space = self.posture.sweep(motion, self._now_s)
        if refusal := self._clearance.refuse(space, self._now_s):
            self._refused(refusal)
            return
        self._left.pop(0)
        self._name, self._space = name, space
        self._run = self._robot.player.start(name, self._now_s)

    def _refused(self, refusal: Refusal) -> None:
        if self._run is None and refusal.code == "not_watched":
            return  # the sensors have only just started
        self.refused_s += WATCHED_EVERY_S
        if self.refused_s > PATIENCE_S:
            self._left.clear()


def _described(lacks: int) -> str:
    """Return TIAGo's description without the last links of its arm."""
    missing = tiago_arm().links[len(tiago_arm().links) - lacks :]
    robot = ElementTree.fromstring(urdf(TIAGO, "tiago"))  # noqa: S314 - our own
    for joint in robot.findall("joint"):
        child = joint.find("child")
        if child is not None and child.get("link") in missing:
            robot.remove(joint)
    return ElementTree.tostring(robot, encoding="unicode")
