"""Navigation like move_base: one goal at a time, move_base's texts for failures, and simulated faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from robots.simulator.navigation import follower
from robots.simulator.navigation.planner import CostMap, Point
from robots.simulator.physics.base import STILL, Twist
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.sensors.laser import Laser, in_world
from robots.simulator.sensors.survey import FREE, Survey, surveyed

HULL_M = 0.275
BODY_M = 1.1  # height of the body
CHEST_M = 1.0  # height at which people are wider than their legs: a real costmap has it from the depth camera
PLANNED_M = 0.30  # radius of the robot in plans
SCAN_S = 0.1
REPLANS_S = 1.0  # pause between two plans around an obstacle that is not on the map
# Length of the path ahead that is checked: obstacles farther away are checked later, from nearer.
CHECKED_AHEAD_M = 1.5
MOVED_M = 0.15
GIVES_UP_S = 15.0  # without progress, as move_base with its recovery behaviours

NO_PLAN = "Failed to find a valid plan. Even after executing recovery behaviors."
NO_CONTROL = "Failed to find a valid control. Even after executing recovery behaviors."
REACHED = "Goal reached."


class Phase(Enum):
    """State of a goal."""

    DRIVING = "driving"
    REACHED = "reached"
    FAILED = "failed"


@dataclass
class GoalDrive:
    """A drive to a goal. `path` is in the map frame; `text` is the reason of its end."""

    goal: Pose
    path: list[Point] = field(default_factory=list)
    phase: Phase = Phase.DRIVING
    there: bool = False  # at the goal's position: the robot only turns to the heading
    text: str = ""
    moved_from: Point = (math.inf, math.inf)  # position at the last progress
    moved_s: float = -math.inf  # time of the last progress
    planned_s: float = -math.inf


class Navigator:
    """Drives one robot by map, localisation, laser, and a scan at chest height in place of a depth camera.

    Times are seconds of one clock.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._costs = CostMap(_known(robot), PLANNED_M)
        x, y, _, yaw = robot.body.laser.pose
        chest = replace(robot.body.laser, pose=(x, y, CHEST_M, yaw))
        random = np.random.default_rng(0)  # a separate generator: the noise of the scan topic stays the same
        self._eyes = [Laser(mount, random) for mount in (robot.body.laser, chest)]
        self._seen = np.empty((0, 2))
        self._seen_s = -math.inf
        self.drive: GoalDrive | None = None

    def go(self, goal: Pose, now: float) -> GoalDrive:
        """Begin a goal (map frame). The drive ends at once if there is no path."""
        self.drive = GoalDrive(goal, moved_s=now)
        self._costs.mark(())
        self._plan(self.drive, now)
        return self.drive

    def cancel(self) -> None:
        """Forget the goal."""
        self.drive = None

    def step(self, now: float) -> Twist | None:
        """Return the next twist of the base; None without a running goal."""
        drive = self.drive
        if drive is None or drive.phase is not Phase.DRIVING:
            return None
        pose = self._robot.believed()
        if pose is None:
            drive.phase, drive.text = Phase.FAILED, NO_PLAN
            return STILL
        if self._robot.faults.navigation_blind:
            return _straight_on(drive.goal, pose, backs=self._robot.faults.navigation_backs)
        if now - self._seen_s >= SCAN_S:
            self._look(now)
        drive.there = follower.is_there(drive.path, pose, drive.there)
        clear_m = self._costs.clear_m((pose.x, pose.y))
        twist = follower.follow(drive.path, drive.goal.yaw, pose, clear_m, drive.there)
        if twist is None:
            drive.phase, drive.text = Phase.REACHED, REACHED
            return STILL
        sent = follower.held_back(twist, self._seen, HULL_M)
        self._judge(drive, pose, sent, now)
        return STILL if drive.phase is not Phase.DRIVING else sent

    def _judge(self, drive: GoalDrive, pose: Pose, sent: Twist, now: float) -> None:
        """Plan again if the path is blocked; give up after `GIVES_UP_S` without progress."""
        if math.dist(pose[:2], drive.moved_from) > MOVED_M:
            drive.moved_from, drive.moved_s = (pose.x, pose.y), now
        if now - drive.planned_s >= REPLANS_S and (sent.vx == 0.0 or self._is_barred(drive.path, pose)):
            self._costs.mark(in_world(pose, x, y) for x, y in self._seen)
            self._plan(drive, now, forgive=True)
        if now - drive.moved_s > GIVES_UP_S:
            drive.phase, drive.text = Phase.FAILED, NO_CONTROL

    def _is_barred(self, path: list[Point], pose: Pose) -> bool:
        """Return whether a point that was seen is nearer to the path ahead than plans allow."""
        ahead = [
            point
            for point in path[follower.nearest(path, pose) :]
            if math.dist(point, pose[:2]) < CHECKED_AHEAD_M
        ]
        if not ahead or not len(self._seen):
            return False
        seen = np.array([in_world(pose, x, y) for x, y in self._seen])
        apart = np.linalg.norm(np.array(ahead)[:, None] - seen[None], axis=2)
        return bool((apart < PLANNED_M).any())

    def _plan(self, drive: GoalDrive, now: float, *, forgive: bool = False) -> None:
        pose = self._robot.believed()
        path: list[Point] = []
        if pose is not None and not self._robot.faults.navigation_fails:
            path = self._costs.plan((pose.x, pose.y), drive.goal[:2])
        drive.planned_s = now
        if path:
            drive.path = path
        elif not forgive:  # the obstacle may go away: the robot waits until it gives up
            drive.phase, drive.text = Phase.FAILED, NO_PLAN

    def _look(self, now: float) -> None:
        """Measure the visible points at the heights of the laser and of a chest, in the base frame."""
        self._seen_s = now
        points = []
        for eyes in self._eyes:
            x, y, _, yaw = eyes.mount.pose
            ranges = eyes.scan(self._robot.physics)
            good = np.isfinite(ranges) & (ranges < 3.0)
            angles = eyes.angles[good] + yaw
            points.append(
                np.column_stack([x + ranges[good] * np.cos(angles), y + ranges[good] * np.sin(angles)])
            )
        self._seen = np.concatenate(points)


def _known(robot: Robot) -> Survey:
    """Return the map with furniture at all heights of the body, also table tops, which no laser sees.

    A robot that starts under a table top gets the laser's map only.
    """
    physics, size, low_m = robot.physics, robot.world.size, robot.body.laser.pose[2]
    known = surveyed(physics, size, low_m, BODY_M)
    return known if (known.cells == FREE).any() else surveyed(physics, size, low_m)


def _straight_on(goal: Pose, pose: Pose, *, backs: bool) -> Twist:
    """Return full speed towards the goal, as the faults `navigation_blind` and `navigation_backs` demand."""
    yaw = pose.yaw + (math.pi if backs else 0.0)
    off = math.remainder(math.atan2(goal.y - pose.y, goal.x - pose.x) - yaw, math.tau)
    if abs(off) > follower.TURN_FIRST_RAD:
        return Twist(w=follower.turn_towards(off))
    return Twist(-follower.FASTEST_MPS if backs else follower.FASTEST_MPS, 0.0, off)
