"""Decide whether a sensor could see a touched object, from the true geometry and independently of the gate.

It checks the touched point and all points of the same object within 0.3 m of it, at any height below the
robot's top. The object was seen if one of these points was in the field of view, range and height of a
working sensor, not hidden, at two measurements before the contact. A sonar's echo shows no object behind it,
and a lost echo shows no object. The depth camera counts up to 4 m and above 5 cm: beyond and below, no method
can separate obstacles from the floor. The laser also counts up to 4 m: farther away a leg is thinner than the
gap between its beams. Objects that were seen for less than 0.5 s are counted separately: a sonar measures a
leg between two cones only when the leg is beside the sonar.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.world.truth import TOP_M, outline
from robots.simulator.joints.frames import camera_pose
from robots.simulator.physics.mujoco_world import Snapshot, WorldReader
from robots.simulator.sensors.depth import FARTHEST_M as DEPTH_FARTHEST_M
from robots.simulator.sensors.depth import FOCAL_PX, HEIGHT, WIDTH
from robots.simulator.sensors.laser import in_world

if TYPE_CHECKING:
    from benchmarks.world.loop import Loop, Touch

LASER, DEPTH = "laser", "depth"
NEAR_M = 0.30  # from the contact
REACH_M = 4.0
FLOOR_M = 0.05
LEVEL_M = 0.05  # between the heights that are checked
SAME_M = 0.03  # a ray that ends within this distance of a point has reached the point
ECHO_M = 0.05  # an echo that is at most this much shorter than a point's distance may come from it
LOOKS = 2  # measurements in which the object must have been in view
IN_TIME_S = 0.5  # before the contact: an object that is seen later leaves no time to stop

Floats = NDArray[np.float64]


class Look(NamedTuple):
    """One measurement of a working sensor: laser, sonar (by frame) or depth camera.

    `reading` is the sonar's range, or the head's pan for the depth camera.
    """

    time_s: float
    sensor: str
    reading: float
    snapshot: Snapshot
    tilt: float = 0.0  # of the head, for the depth camera


class Seen(NamedTuple):
    """The sensors that saw an object, and how long before the contact the first of them saw it."""

    sensors: tuple[str, ...]
    before_s: float

    @property
    def in_time(self) -> bool:
        """Return whether there was time to stop."""
        return self.before_s >= IN_TIME_S

    def __str__(self) -> str:
        return f"{', '.join(self.sensors)}, {self.before_s:.1f} s before"


def seen(loop: Loop, touch: Touch) -> Seen | None:
    """Return how the object of `touch` was seen before; None: no sensor can have seen it."""
    reader = WorldReader(loop.robot.physics)
    reader.follow(loop.robot.physics.snapshot())
    root, local = _touched(reader, touch)
    times: dict[str, list[float]] = {}
    for look in loop.looks:
        if look.time_s < touch.time_s:
            reader.follow(look.snapshot)
            points = reader.data.xpos[root] + local @ reader.data.xmat[root].reshape(3, 3).T
            if _in_view(loop, reader, look, points):
                times.setdefault(look.sensor, []).append(look.time_s)
    known = {sensor: looks[LOOKS - 1] for sensor, looks in times.items() if len(looks) >= LOOKS}
    return Seen(tuple(known), touch.time_s - min(known.values())) if known else None


def _touched(reader: WorldReader, touch: Touch) -> tuple[int, Floats]:
    """Return the touched body, and its points near the contact, in its own frame."""
    model, data = reader.model, reader.data
    geom = model.geom(touch.other).id
    root = int(model.body_rootid[model.geom_bodyid[geom]])
    # All walls and boxes belong to the world's body: for them, an object is one geometry.
    mine = [geom] if root == 0 else np.flatnonzero(model.body_rootid[model.geom_bodyid] == root).tolist()
    points = np.concatenate([_surface(model, data, each) for each in mine])
    near = np.hypot(*(points[:, :2] - touch.at).T) < NEAR_M
    local = (points[near] - data.xpos[root]) @ data.xmat[root].reshape(3, 3)
    return root, local


def _surface(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Floats:
    """Return points on the sides of an upright box or cylinder, up to the robot's height, (N, 3)."""
    around = outline(model, data, geom)
    is_round = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER
    upright = float(model.geom_size[geom][1 if is_round else 2])
    middle = float(data.geom_xpos[geom][2])
    bottom, top = middle - upright, min(middle + upright, TOP_M)
    if bottom >= top:
        return np.zeros((0, 3))
    levels = np.linspace(bottom, top, max(2, math.ceil((top - bottom) / LEVEL_M) + 1))
    return np.concatenate([np.column_stack((around, np.full(len(around), level))) for level in levels])


def _in_view(loop: Loop, reader: WorldReader, look: Look, points: Floats) -> bool:
    """Return whether the sensor could see any of the points."""
    if look.sensor == LASER:
        origin, shown = _before_laser(loop, reader, points)
    elif look.sensor == DEPTH:
        origin, shown = _before_camera(loop, reader, look, points)
    else:
        origin, shown = _before_sonar(loop, reader, look, points)
    if not len(shown):
        return False
    way = shown - origin
    far = np.linalg.norm(way, axis=1)
    met = reader.cast(origin, np.ascontiguousarray(way / far[:, None]))
    return bool(((met < 0.0) | (met > far - SAME_M)).any())


def _before_laser(loop: Loop, reader: WorldReader, points: Floats) -> tuple[Floats, Floats]:
    mount = loop.robot.laser.mount
    x, y, z, yaw = mount.pose
    origin = np.array([*in_world(reader.pose, x, y), z])
    levels = np.unique(points[:, 2])
    spans = any(low <= z <= high for low, high in pairwise(levels) if high - low <= LEVEL_M + 1e-6)
    if not spans:
        return origin, np.zeros((0, 3))
    height = levels[np.abs(levels - z).argmin()]
    at_height = points[points[:, 2] == height]
    at_height = np.column_stack((at_height[:, :2], np.full(len(at_height), z)))
    way = at_height - origin
    far = np.hypot(way[:, 0], way[:, 1])
    bearing = np.arctan2(way[:, 1], way[:, 0]) - (reader.pose.yaw + yaw)
    off = np.abs(np.remainder(bearing + math.pi, math.tau) - math.pi)
    return origin, at_height[
        (off < mount.half_angle) & (far > mount.shortest_m) & (far < min(mount.longest_m, REACH_M))
    ]


def _before_sonar(loop: Loop, reader: WorldReader, look: Look, points: Floats) -> tuple[Floats, Floats]:
    mount = next(sonar.mount for sonar in loop.robot.sonars if sonar.mount.frame == look.sensor)
    x, y, z, yaw = mount.pose
    origin = np.array([*in_world(reader.pose, x, y), z])
    way = points - origin
    far = np.linalg.norm(way, axis=1)
    heading = reader.pose.yaw + yaw
    along = way[:, 0] * math.cos(heading) + way[:, 1] * math.sin(heading)
    heard = min(look.reading + ECHO_M + 2.0 * mount.sigma_m, mount.longest_m)
    return origin, points[(along > far * math.cos(mount.fov / 2.0)) & (far < heard)]


def _before_camera(loop: Loop, reader: WorldReader, look: Look, points: Floats) -> tuple[Floats, Floats]:
    camera = camera_pose(loop.joints(look.reading, look.tilt))
    cos, sin = math.cos(reader.pose.yaw), math.sin(reader.pose.yaw)
    to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array(
        [*in_world(reader.pose, float(camera.origin[0]), float(camera.origin[1])), camera.origin[2]]
    )
    forward, left, up = ((points - origin) @ (to_world @ camera.axes)).T
    nearest_m = loop.case.conditions.sensors.depth_nearest_m
    shown = (forward > nearest_m) & (forward < min(DEPTH_FARTHEST_M, REACH_M)) & (points[:, 2] > FLOOR_M)
    shown &= np.abs(left) < forward * WIDTH / 2.0 / FOCAL_PX
    shown &= np.abs(up) < forward * HEIGHT / 2.0 / FOCAL_PX
    return origin, points[shown]


class Contact(NamedTuple):
    """The first contact of a run: part and object, the robot's speed, and how the object was seen before."""

    what: str
    mps: float
    seen: Seen | None

    def __str__(self) -> str:
        known = f"seen by {self.seen}" if self.seen else "no sensor can have seen it"
        return f"{self.what} at {self.mps:.2f} m/s, {known}"


class Count(NamedTuple):
    """Numbers of contacts, by how the object was seen before."""

    known: int  # seen in time
    late: int
    unseen: int


def known_in_time(contact: Contact | None) -> bool:
    """Return whether there was a contact with an object that a sensor had seen in time."""
    return contact is not None and contact.seen is not None and contact.seen.in_time


def count(contacts: Iterable[Contact | None]) -> Count:
    met = [contact for contact in contacts if contact]
    known = sum(known_in_time(contact) for contact in met)
    unseen = sum(contact.seen is None for contact in met)
    return Count(known, len(met) - known - unseen, unseen)


def first_contact(loop: Loop) -> Contact | None:
    """Return the first contact of a run that was played; None: no contact."""
    if not loop.trace.touches:
        return None
    touch = loop.trace.touches[0]
    speed = math.hypot(touch.robot.vx, touch.robot.vy)
    return Contact(f"{touch.part} / {touch.other}", speed, seen(loop, touch))


def worst_first(contact: Contact) -> tuple[bool, bool, float]:
    """Return a sort key: seen in time first, then seen late, then not seen; the fastest first."""
    return not known_in_time(contact), contact.seen is None, -contact.mps
