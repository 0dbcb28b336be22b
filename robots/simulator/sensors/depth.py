"""The head's depth camera by ray casting, with a structured-light camera's faults."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.simulator.joints.frames import Placed
from robots.simulator.physics.mujoco_world import WorldReader

WIDTH = 640
HEIGHT = 480
FOCAL_PX = WIDTH / 2.0 / math.tan(math.radians(63.0) / 2.0)
NEAREST_M = 0.3
FARTHEST_M = 8.0

# Across a picture: one ray for each square of pixels. One ray for each pixel would cost sixteen times as
# much.
_RAYS = 160
_NOISE_PER_M = 0.0015  # sigma grows with the square of the distance
_DROPOUT_SHARE = 0.01
_HOLE_SHARE = 0.2  # of a picture's sides: largest length and width of a hole


class DepthCamera:
    """Takes pictures of distances, 63 degrees wide. `holes` are rectangles without measurements in each picture."""

    def __init__(
        self,
        random: np.random.Generator,
        size: tuple[int, int] = (WIDTH, HEIGHT),
        nearest_m: float = NEAREST_M,
        holes: int = 0,
    ) -> None:
        self._random = random
        self._nearest_m = nearest_m
        self._holes = holes
        width, height = size
        focal = FOCAL_PX * width / WIDTH
        self._coarse = coarse = max(width // _RAYS, 1)
        # Offsets of each square's middle, right of and below the optical axis, per metre along this axis.
        across = (np.arange(coarse / 2, width, coarse) - width / 2.0) / focal
        down = (np.arange(coarse / 2, height, coarse) - height / 2.0) / focal
        left, up = np.meshgrid(-across, -down)
        self._per_metre = np.stack((-left, -up, np.ones_like(left)), axis=-1).astype(np.float32)
        rays = np.stack((np.ones_like(left), left, up), axis=-1)
        length = np.linalg.norm(rays, axis=-1)
        self._shape = left.shape
        self._rays = (rays / length[..., None]).reshape(-1, 3)  # forward, left, up
        self._ahead = (
            1.0 / length
        ).ravel()  # a ray's extent along the optical axis, as a share of its length

    def image(self, reader: WorldReader, camera: Placed) -> NDArray[np.float32]:
        """Return distances along the optical axis in metres (height, width); nan without a measurement."""
        origin, axes = reader.in_world(camera)
        distance = reader.cast(origin, self._rays @ axes.T)
        depth = self._as_measured(distance * self._ahead).reshape(self._shape)
        return self._with_holes(depth).repeat(self._coarse, axis=0).repeat(self._coarse, axis=1)

    def points(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return one point (right, down, ahead; metres) for each ray of a picture, by rows: (120, 160, 3)."""
        points: NDArray[np.float32] = depth[:: self._coarse, :: self._coarse, None] * self._per_metre
        return points

    def _as_measured(self, depth: NDArray[np.float64]) -> NDArray[np.float32]:
        measured = depth + self._random.standard_normal(depth.shape) * _NOISE_PER_M * depth**2
        lost = self._random.random(depth.shape) < _DROPOUT_SHARE
        measured[lost | (measured < self._nearest_m) | (measured > FARTHEST_M)] = np.nan
        return measured.astype(np.float32)

    def _with_holes(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        for _ in range(self._holes):
            row, column, high, wide = self._random.random(4)
            top, left = int(row * depth.shape[0]), int(column * depth.shape[1])
            high, wide = _HOLE_SHARE * high * depth.shape[0], _HOLE_SHARE * wide * depth.shape[1]
            depth[top : top + int(high), left : left + int(wide)] = np.nan
        return depth


def as_millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Convert to the usual format of real robots (16UC1): millimetres, 0 without a measurement."""
    millimetres: NDArray[np.uint16] = np.nan_to_num(depth * 1000.0, nan=0.0).astype(np.uint16)
    return millimetres
