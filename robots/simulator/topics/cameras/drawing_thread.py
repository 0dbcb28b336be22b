"""One thread takes the pictures of all cameras, so that they never delay the robot."""

from __future__ import annotations

import logging
import threading
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from robots.simulator.cameras.drawing import Drawing, NoCameraError
from robots.simulator.cameras.lens import Lens
from robots.simulator.joints.frames import Placed
from robots.simulator.physics.mujoco_world import Physics, Snapshot, WorldReader
from robots.simulator.ros_side import Stamp

log = logging.getLogger(__name__)

_END_S = 2.0


class Moment(NamedTuple):
    """The world and the camera at one moment. `monotonic_s`: that moment on CLOCK_MONOTONIC."""

    stamp: Stamp
    monotonic_s: float
    snapshot: Snapshot
    camera: Placed


class Taker(Protocol):
    """A camera: takes and publishes a picture, on the drawing thread."""

    def draw_and_publish(self, thread: DrawingThread, moment: Moment) -> None:
        """Take the picture of `moment`; `thread.reader` has the world of that moment."""


class DrawingThread:
    """Takes pictures in the order of the requests. Each camera has one request: a newer one replaces it."""

    def __init__(self, physics: Physics) -> None:
        self.reader = WorldReader(physics)
        self.blind = False  # this computer cannot draw in colour
        self._drawing: Drawing | None = None
        self._waiting: dict[Taker, Moment] = {}
        self._ending = False
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="drawing", daemon=True)
        self._thread.start()

    def request(self, taker: Taker, moment: Moment) -> None:
        """Let `taker` take a picture of `moment` soon."""
        with self._news:
            self._waiting[taker] = moment
            self._news.notify()

    def colour(self, moment: Moment, lens: Lens) -> NDArray[np.uint8] | None:
        """Draw the world in colour: (height, width, 3), red green blue; None if this computer cannot draw."""
        if self._drawing is None and not self.blind:
            try:
                self._drawing = Drawing(self.reader)
            except NoCameraError as error:
                self.blind = True
                log.warning("no colour camera on this machine: %s", error)
        return self._drawing.image(moment.camera, lens) if self._drawing is not None else None

    def close(self) -> None:
        """End the thread, which alone can release the drawing context."""
        with self._news:
            self._ending = True
            self._news.notify()
        self._thread.join(_END_S)

    def _run(self) -> None:
        while (request := self._next()) is not None:
            taker, moment = request
            self.reader.follow(moment.snapshot)
            taker.draw_and_publish(self, moment)
        if self._drawing is not None:
            self._drawing.close()

    def _next(self) -> tuple[Taker, Moment] | None:
        with self._news:
            self._news.wait_for(lambda: self._waiting or self._ending)
            if self._ending:
                return None
            taker = next(iter(self._waiting))
            return taker, self._waiting.pop(taker)
