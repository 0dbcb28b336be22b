"""The head's colour camera: MuJoCo draws off-screen through EGL, without shadows.

A context belongs to the thread that made it: make, use and close a `Camera` in one thread.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.simulator.joints.joint_table import CameraPose
from robots.simulator.physics.mujoco_world import Onlooker
from robots.simulator.sensors.depth import FOCAL_PX, HEIGHT, WIDTH

_MOST_GEOMS = 500


class NoCameraError(Exception):
    """This machine cannot draw without a display."""


class Camera:
    """Takes pictures in colour; raises `NoCameraError` if this computer cannot draw."""

    def __init__(self, onlooker: Onlooker) -> None:
        self._context = _context()
        self._context.make_current()
        self._onlooker = onlooker
        self._scene = mujoco.MjvScene(onlooker.model, maxgeom=_MOST_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._options = mujoco.MjvOption()
        self._renderer = mujoco.MjrContext(onlooker.model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        self._frame = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
        self._view = mujoco.MjvCamera()

    def image(self, pose: CameraPose) -> NDArray[np.uint8]:
        """The camera image from `pose` (base frame): (480, 640, 3), red green blue."""
        looker = self._onlooker
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            looker.model, looker.data, self._options, None, self._view, everything, self._scene
        )
        self._aim(pose)
        mujoco.mjr_render(self._frame, self._scene, self._renderer)
        upside_down = np.empty((HEIGHT, WIDTH, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(upside_down, None, self._frame, self._renderer)
        return upside_down[::-1]

    def close(self) -> None:
        """Release the context."""
        self._renderer.free()
        self._context.free()

    def _aim(self, pose: CameraPose) -> None:
        """Place both of the scene's eyes at the camera."""
        robot = self._onlooker.pose
        cos, sin = math.cos(robot.yaw), math.sin(robot.yaw)
        to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        where = to_world @ pose.origin + np.array([robot.x, robot.y, 0.0])
        axes = to_world @ pose.axes
        for eye in self._scene.camera:
            eye.pos = where
            eye.forward = axes[:, 0]
            eye.up = axes[:, 2]
            near = eye.frustum_near
            eye.frustum_top = near * HEIGHT / 2.0 / FOCAL_PX
            eye.frustum_bottom = -eye.frustum_top
            eye.frustum_center = 0.0
            eye.frustum_width = near * WIDTH / 2.0 / FOCAL_PX


def _context() -> Any:
    """An off-screen drawing context of mujoco.egl."""
    try:
        from mujoco.egl import GLContext
        from OpenGL.error import Error as GraphicsError  # type: ignore[import-untyped]
    # PyOpenGL's exception depends on the missing library.
    except (ImportError, AttributeError, OSError) as error:
        raise NoCameraError(str(error)) from error
    try:
        return GLContext(WIDTH, HEIGHT)
    except (ImportError, RuntimeError, GraphicsError) as error:
        raise NoCameraError(str(error)) from error
