"""MuJoCo draws pictures in colour off-screen through EGL, without costly effects.

A context belongs to the thread that made it: make, use and close a `Drawing` in one thread.
"""

from __future__ import annotations

import os
from typing import Any

# Without a graphics card, Mesa draws in software. With 0, it does so on this thread only, not on all cores.
os.environ.setdefault("LP_NUM_THREADS", "0")

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.simulator.cameras.lens import HEAD_LENS, Lens
from robots.simulator.joints.frames import Placed
from robots.simulator.physics.mujoco_world import WorldReader
from robots.simulator.physics.scene import DECORATION_GROUP

_MOST_GEOMS = 500
# Costly without a graphics card. In a room nobody sees the haze at the horizon.
_EFFECTS = (
    mujoco.mjtRndFlag.mjRND_SHADOW,
    mujoco.mjtRndFlag.mjRND_REFLECTION,
    mujoco.mjtRndFlag.mjRND_HAZE,
)


class NoCameraError(Exception):
    """This machine cannot draw without a display."""


class Drawing:
    """Draws the pictures of all colour cameras; raises `NoCameraError` if this computer cannot draw."""

    def __init__(self, reader: WorldReader) -> None:
        self._context = _context()
        self._context.make_current()
        self._reader = reader
        self._scene = mujoco.MjvScene(reader.model, maxgeom=_MOST_GEOMS)
        for effect in _EFFECTS:
            self._scene.flags[effect] = 0
        self._options = mujoco.MjvOption()
        self._options.geomgroup[DECORATION_GROUP] = 1
        self._renderer = mujoco.MjrContext(reader.model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        self._view = mujoco.MjvCamera()

    def image(self, pose: Placed, lens: Lens) -> NDArray[np.uint8]:
        """Return the picture of a camera at `pose` (base frame): (height, width, 3), red green blue."""
        looker = self._reader
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            looker.model, looker.data, self._options, None, self._view, everything, self._scene
        )
        self._aim(pose, lens)
        frame = mujoco.MjrRect(0, 0, lens.width, lens.height)
        mujoco.mjr_render(frame, self._scene, self._renderer)
        upside_down = np.empty((lens.height, lens.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(upside_down, None, frame, self._renderer)
        return upside_down[::-1]

    def close(self) -> None:
        """Release the context."""
        self._renderer.free()
        self._context.free()

    def _aim(self, pose: Placed, lens: Lens) -> None:
        """Place both of the scene's eyes at the camera."""
        where, axes = self._reader.in_world(pose)
        for eye in self._scene.camera:
            eye.pos = where
            eye.forward = axes[:, 0]
            eye.up = axes[:, 2]
            near = eye.frustum_near
            eye.frustum_top = near * lens.height / 2.0 / lens.focal_px
            eye.frustum_bottom = -eye.frustum_top
            eye.frustum_center = 0.0
            eye.frustum_width = near * lens.width / 2.0 / lens.focal_px


def _context() -> Any:
    """Return an off-screen drawing context of mujoco.egl."""
    try:
        from mujoco.egl import GLContext
        from OpenGL.error import Error as GraphicsError  # type: ignore[import-untyped]
    # PyOpenGL's exception depends on the missing library.
    except (ImportError, AttributeError, OSError) as error:
        raise NoCameraError(str(error)) from error
    try:
        return GLContext(HEAD_LENS.width, HEAD_LENS.height)
    except (ImportError, RuntimeError, GraphicsError) as error:
        raise NoCameraError(str(error)) from error
