"""The robot's body in the world: MuJoCo computes its motion and contacts. Without ROS."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import NamedTuple

# Only the cameras draw, in their own context (`cameras.drawing`): MuJoCo must not search for a display.
os.environ.setdefault("MUJOCO_GL", "disable")

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.simulator.joints.arm import SEGMENTS, Capsule
from robots.simulator.joints.frames import Placed
from robots.simulator.physics.base import Twist, clamp
from robots.simulator.physics.scene import ROBOT_GROUP, scene_xml
from robots.simulator.sensors.body import Body
from robots.simulator.worlds import World

# Largest force and torque of the motors on the whole robot; a fixed obstacle resists more.
_PUSH_N = 250.0
_TWIST_NM = 80.0
_SEEN_GROUPS = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)
_FARTHEST_M = 1000.0

Vector = NDArray[np.float64]


class Pose(NamedTuple):
    """Planar pose in the world: metres, radians."""

    x: float
    y: float
    yaw: float


class Contact(NamedTuple):
    """The robot's `part` touches `other`."""

    part: str
    other: str
    force_n: float
    at: tuple[float, float] = (0.0, 0.0)  # in the world, metres


class Snapshot(NamedTuple):
    """The poses of all movable bodies at one moment."""

    qpos: Vector
    mocap_pos: Vector
    mocap_quat: Vector


class WorldView:
    """The world at one moment: where the robot is, and what rays hit."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self._robot_id = model.body("robot").id

    @property
    def pose(self) -> Pose:
        """The robot's true pose."""
        x, y, yaw = self.data.qpos[:3].tolist()
        return Pose(x, y, yaw)

    def in_world(self, part: Placed) -> Placed:
        """Return a pose of the base frame in the world's frame."""
        robot = self.pose
        cos, sin = math.cos(robot.yaw), math.sin(robot.yaw)
        turned = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return Placed(turned @ part.origin + np.array([robot.x, robot.y, 0.0]), turned @ part.axes)

    def cast(self, origin: Vector, directions: Vector) -> Vector:
        """Return the distances along unit rays (N, 3) from one point, in the world's frame; -1 without a hit."""
        count = len(directions)
        hit = np.empty((count, 1), dtype=np.int32)
        distance = np.empty(count)
        mujoco.mj_multiRay(
            self.model,
            self.data,
            origin.reshape(3, 1),
            directions.reshape(-1, 1),
            _SEEN_GROUPS,
            True,
            self._robot_id,
            hit,
            distance.reshape(-1, 1),
            None,
            count,
            _FARTHEST_M,
        )
        return distance


class WorldReader(WorldView):
    """Reads the world from its own thread, in parallel with the physics."""

    def __init__(self, physics: Physics) -> None:
        super().__init__(physics.model)

    def follow(self, snapshot: Snapshot) -> None:
        """Set the world to `snapshot`."""
        self.data.qpos[:] = snapshot.qpos
        self.data.mocap_pos[:] = snapshot.mocap_pos
        self.data.mocap_quat[:] = snapshot.mocap_quat
        mujoco.mj_kinematics(self.model, self.data)


class Physics(WorldView):
    """One robot in one world, stepped in real time by its owner."""

    def __init__(self, world: World, body: Body, start: Pose) -> None:
        super().__init__(mujoco.MjModel.from_xml_string(scene_xml(world, body)))
        self.timestep_s = float(self.model.opt.timestep)
        self._mass = body.mass_kg
        self._inertia = float(self.model.body("robot").inertia[2])
        self._mocaps = {person.name: int(self.model.body(person.name).mocapid[0]) for person in world.people}
        self._arm = [self.model.body(f"robot {part.name}").id for part in SEGMENTS] if body.upper_body else []
        is_part = self.model.geom_group == ROBOT_GROUP
        self._parts = np.flatnonzero(is_part).tolist()
        self._others = np.flatnonzero(~is_part & (self.model.geom_contype != 0)).tolist()
        self.data.qpos[:3] = start
        mujoco.mj_forward(self.model, self.data)

    @property
    def velocity(self) -> Twist:
        """The robot's true velocity, in its own frame."""
        x, y, w = self.data.qvel[:3].tolist()
        yaw = float(self.data.qpos[2])
        cos, sin = math.cos(yaw), math.sin(yaw)
        return Twist(cos * x + sin * y, cos * y - sin * x, w)

    def step(self, wanted: Twist, steps: int) -> None:
        """Push towards velocity `wanted` (base frame) for `steps` time steps."""
        for _ in range(steps):
            self._push(wanted)
            mujoco.mj_step(self.model, self.data)

    def _push(self, wanted: Twist) -> None:
        """Apply the force that reaches `wanted` within one step, limited to the motors' force."""
        yaw = float(self.data.qpos[2])
        now = self.velocity
        gain = self._mass / self.timestep_s
        ahead = (wanted.vx - now.vx) * gain
        left = (wanted.vy - now.vy) * gain
        strength = math.hypot(ahead, left)
        if strength > _PUSH_N:
            ahead, left = ahead * _PUSH_N / strength, left * _PUSH_N / strength
        cos, sin = math.cos(yaw), math.sin(yaw)
        turn = (wanted.w - now.w) * self._inertia / self.timestep_s
        self.data.qfrc_applied[:3] = (
            cos * ahead - sin * left,
            sin * ahead + cos * left,
            clamp(turn, -_TWIST_NM, _TWIST_NM),
        )

    def contacts(self) -> list[Contact]:
        """Return the robot's present contacts, the strongest force first."""
        found = []
        force = np.zeros(6)
        for index in range(self.data.ncon):
            contact = self.data.contact[index]
            first, second = (int(geom) for geom in contact.geom)
            part, other = (first, second) if first in self._parts else (second, first)
            mujoco.mj_contactForce(self.model, self.data, index, force)
            x, y, _ = contact.pos.tolist()
            found.append(Contact(self._name(part), self._name(other), float(force[0]), (x, y)))
        return sorted(found, key=lambda contact: -contact.force_n)

    def clearance_m(self, reach_m: float = 3.0) -> float:
        """Return the gap (m) between hull and nearest object: at most `reach_m`, negative inside an object."""
        return min(
            (
                mujoco.mj_geomDistance(self.model, self.data, part, other, reach_m, None)
                for part in self._parts
                for other in self._others
            ),
            default=reach_m,
        )

    def snapshot(self) -> Snapshot:
        """Return all present poses, for a `WorldReader` on another thread."""
        data = self.data
        return Snapshot(data.qpos.copy(), data.mocap_pos.copy(), data.mocap_quat.copy())

    def place_person(self, name: str, x: float, y: float, yaw: float) -> None:
        """Place a person; takes effect with the next step."""
        mocap = self._mocaps[name]
        self.data.mocap_pos[mocap] = (x, y, 0.0)
        self.data.mocap_quat[mocap] = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))

    def place_furniture(self, name: str, x: float, y: float) -> None:
        """Place a chair or a table without turning it; takes effect with the next step."""
        self.model.body(name).pos[:2] = (x, y)

    def place_arm(self, capsules: Sequence[Capsule]) -> None:
        """Set the arm's segments, from the next step on. They pass through bodies; contacts are reported."""
        for body, (middle, rotation) in zip(self._arm, capsules, strict=True):
            self.model.body_pos[body] = middle
            self.model.body_quat[body] = rotation

    def place_robot(self, pose: Pose) -> None:
        """Place the robot, at rest."""
        self.data.qpos[:3] = pose
        self.data.qvel[:3] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def _name(self, geom: int) -> str:
        return str(self.model.geom(geom).name)
