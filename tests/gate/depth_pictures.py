"""Depth pictures of boxes, as the simulated camera draws them, and a robot that sees them."""

from __future__ import annotations

import math
from functools import lru_cache, reduce

import numpy as np

from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.sensing.depth import (
    Cloud,
    Columns,
    DepthImage,
    Lens,
    Picture,
    columns_of,
    picture_of_image,
    top_m,
)
from robots.shared.configuration.gate_profile import DepthView
from robots.shared.geometry.poses import Pose
from tests.gate.conftest import Feeder, tiago_profile

FOV = math.radians(63.0)
WIDTH, HEIGHT = 640, 480
LENS = Lens.seeing(FOV, WIDTH, HEIGHT)
VIEW = DepthView(height_m=1.10)
HOME_M = 1.217  # camera height with the torso in TIAGo's home posture
LOOK_AHEAD = -0.68

ORIGIN = Pose(0.0, 0.0, 0.0)
FLOOR = ((-20.0, -20.0, -1.0), (20.0, 20.0, 0.0))
TABLE = ((1.6, -0.8, 0.70), (2.6, 0.8, 0.74))  # its near edge 1.6 m from the base
WALL = ((3.0, -5.0, 0.0), (3.1, 5.0, 2.5))


def camera(tilt=0.0, pan=0.0, height_m=HOME_M):
    """The camera's pose; a positive tilt looks up."""
    forward = np.array([math.cos(tilt) * math.cos(pan), math.cos(tilt) * math.sin(pan), math.sin(tilt)])
    left = np.array([-math.sin(pan), math.cos(pan), 0.0])
    to_base = np.eye(4)
    to_base[:3, :3] = np.stack((-left, -np.cross(forward, left), forward), axis=1)
    to_base[:3, 3] = (0.175, 0.0, height_m)
    return to_base


@lru_cache(maxsize=4)  # a robot that stands sees the same picture again
def ahead_of(boxes, pose_of_camera, at):
    """Distance (m along the camera's axis) of the nearest axis-parallel box, one ray for 4 x 4 pixels."""
    to_base = np.frombuffer(pose_of_camera).reshape(4, 4)
    right = (np.arange(2, WIDTH, 4) - LENS.cx) / LENS.fx  # like the simulated camera
    down = (np.arange(2, HEIGHT, 4) - LENS.cy) / LENS.fy
    rays = np.stack(np.broadcast_arrays(right[None, :], down[:, None], 1.0), axis=-1) @ to_base[:3, :3].T
    cos, sin = math.cos(at.yaw), math.sin(at.yaw)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rays, origin = rays @ turn.T, turn @ to_base[:3, 3] + (at.x, at.y, 0.0)
    nearest = np.full(rays.shape[:2], np.inf)
    for low, high in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (np.array(low) - origin) / rays, (np.array(high) - origin) / rays
        enter = reduce(np.fmax, np.moveaxis(np.minimum(first, second), -1, 0))
        leave = reduce(np.fmin, np.moveaxis(np.maximum(first, second), -1, 0))
        nearest = np.where((enter <= leave) & (enter > 0.0), np.minimum(nearest, enter), nearest)
    nearest[np.isinf(nearest)] = np.nan
    return nearest


def thinned(boxes, to_base, at=ORIGIN, noise=0.0, seed=0):
    """As `drawn`, one value for 4 x 4 pixels: the gate looks at no more."""
    corners = tuple((tuple(low), tuple(high)) for low, high in boxes)
    nearest = ahead_of(corners, np.asarray(to_base, dtype=float).tobytes(), at)
    nearest = nearest + np.random.default_rng(seed).standard_normal(nearest.shape) * noise * nearest**2
    return nearest.astype(np.float32)


def drawn(boxes, to_base, **options):
    """Depth picture of axis-parallel boxes from a robot at `at`, m along the camera's axis; NaN: no box."""
    return thinned(boxes, to_base, **options).repeat(4, axis=0).repeat(4, axis=1)


def image(depth, encoding="32FC1", big_endian=False, padding=0):
    kind = np.dtype((">" if big_endian else "<") + ("f4" if encoding == "32FC1" else "u2"))
    values = depth if encoding == "32FC1" else np.nan_to_num(depth * 1000.0)
    rows = values.astype(kind).view(np.uint8).reshape(depth.shape[0], -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    return DepthImage(depth.shape[1], depth.shape[0], encoding, big_endian, rows.shape[1], rows.tobytes())


DIRECTIONS = picture_of_image(image(np.ones((HEIGHT, WIDTH), dtype=np.float32)), LENS)[1:]


def picture(boxes, to_base, **options):
    return picture_of_image(image(drawn(boxes, to_base, **options)), LENS)


def cloud_of(shown: Picture, big_endian=False, organised=True):
    """The same as a point cloud: x, y, z and four bytes of colour for each point."""
    x, y = shown.ahead * shown.right, shown.ahead * shown.down[:, None]
    points = np.stack((x, y, shown.ahead, np.zeros_like(x)), axis=-1).astype(">f4" if big_endian else "<f4")
    rows, columns = x.shape if organised else (1, x.size)
    offsets = {"x": 0, "y": 4, "z": 8}
    return Cloud(columns, rows, 16, 16 * columns, offsets, big_endian, points.tobytes())


def obstacles(boxes, to_base, **options) -> Columns:
    return columns_of(picture(boxes, to_base, **options), to_base, top_m(to_base, VIEW.height_m))


def nearest(columns: Columns) -> float:
    return float(columns.points[:, 0].min())


class Looker(Feeder):
    """A TIAGo whose laser sees an empty hall and whose camera sees boxes (odometry frame)."""

    def __init__(self, boxes, own_m=0.05, **profile) -> None:
        super().__init__(tiago_profile(has_depth=True, depth=DepthView(1.10, own_m), **profile))
        self.boxes = boxes
        self.to_base = camera()
        self.seed = 0
        self.black = []  # boxes of which the camera measures nothing

    def look(self):
        self.seed += 1
        depth = thinned(self.boxes, self.to_base, at=self.pose, noise=0.0015, seed=self.seed)
        if self.black:
            hidden = thinned([*self.boxes, *self.black], self.to_base, at=self.pose)
            depth[hidden < thinned(self.boxes, self.to_base, at=self.pose)] = math.nan
        frame = frame_of(Picture(depth, *DIRECTIONS), self.to_base, self.gate.profile.depth)
        self.gate.observe_depth(frame, self.stamp_s, self.now_s)

    def stand(self, seconds, looks=True):
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.all()
            if looks:
                self.look()

    def back(self, vx):
        """Decide on a reverse by a driver who has looked behind the robot: the first pull is refused."""
        self.decide(vx)
        self.decide()
        return self.decide(vx)

    def nearest_by(self, name):
        known = self.gate.obstacles(self.now_s)
        mine = known.points[known.source == known.names.index(name)]
        ahead = mine[np.abs(mine[:, 1]) < 0.3]
        return float(ahead[:, 0].min()) if len(ahead) else math.inf

    def sensor(self):
        return next(s for s in self.gate.sensor_health(self.now_s) if s.kind == "depth")
