"""Makes the pictures that web processes want: each variant once for all, and of the newest picture only.

One thread does all the work: when encoding is slow, pictures are skipped, and only viewers wait. If only
thumbnails of a camera are wanted, the producer subscribes for one picture at a time: the robot's radio must
not carry video that nobody watches.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from robots.bridge.camera.camera import Arrival, Camera, CameraPicture, damage_text
from robots.bridge.camera.camera_side import CameraSide
from robots.bridge.camera.picture_server import PictureServer, Wants
from robots.bridge.camera.pictures.encoding import VIDEO_HZ, VIDEO_WIDTH
from robots.bridge.camera.pictures.image_header import Damaged
from robots.bridge.robot_clock import RobotClock
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.wire import CameraState, PictureFormat, TakenPicture, Variant

if TYPE_CHECKING:
    from robots.bridge.camera.pictures.h264 import H264Encoder

STATE_S = 0.5  # between two checks of silent cameras
THUMBNAIL_HZ = 1.0  # below this rate, the camera is unsubscribed between two pictures
EARLY_SHARE = 0.8  # of the time between two pictures: a picture may arrive a little early


class _Watched:
    """One camera while somebody watches it."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.video: H264Encoder | None = None  # while a viewer needs video
        self.taken: Arrival | None = None  # the last message that was handled
        self.made_s: dict[Variant, float] = {}
        self.numbers: dict[Variant, int] = {}
        self.state: CameraState | None = None  # the last reported state

    def due(self, wants: Mapping[Variant, float], now_s: float) -> list[Variant]:
        """Return the variants whose rate allows a picture now."""
        return [
            variant
            for variant, rate_hz in wants.items()
            if now_s - self.made_s.get(variant, float("-inf"))
            >= EARLY_SHARE / min(rate_hz, VIDEO_HZ if variant == "video" else rate_hz)
        ]

    def number(self, variant: Variant) -> int:
        """Return the next number of a variant."""
        self.numbers[variant] = self.numbers.get(variant, 0) + 1
        return self.numbers[variant]


class Producer:
    """All cameras of one robot. `emit` and `state` are called on the producer's thread.

    `side` gets the frame in which the cameras' poses are wanted.
    """

    def __init__(
        self,
        config: BridgeConfig,
        server: PictureServer,
        emit: Callable[[TakenPicture, bytes, float], None],
        state: Callable[[CameraState], None],
        side: Callable[[str], CameraSide],
    ) -> None:
        self._sources = {camera.name: camera for camera in config.topics.cameras}
        self.server = server
        self._emit = emit
        self._state = state
        # When the last round of `run` began: a recent time shows that the thread works
        self.looked_s = time.monotonic()
        self.clock = RobotClock()  # as the bridge knows it
        self._awake = threading.Condition()
        self._wants: Wants = {}
        self._watched: dict[str, _Watched] = {}
        self._keys: set[str] = set()
        self._rest_until_s: dict[str, float] = {}  # of cameras of which only thumbnails are wanted
        bases = {camera.base_frame for camera in config.topics.cameras}
        self._side = side(bases.pop() if len(bases) == 1 else "base_footprint")

    def set_wants(self, wants: Wants) -> None:
        """Set what is wanted: camera -> variant -> rate (Hz)."""
        with self._awake:
            self._wants = {name: variants for name, variants in wants.items() if name in self._sources}
            self._awake.notify()

    def require_key(self, camera: str) -> None:
        """Make the next video picture of this camera a key picture."""
        with self._awake:
            self._keys.add(camera)

    def run(self) -> None:
        """Make pictures without end."""
        while True:
            self.looked_s = time.monotonic()
            with self._awake:
                if not self._has_news():
                    self._awake.wait(STATE_S)
                wants, keys, self._keys = self._awake_wants(), self._keys, set()
            self._follow(wants)
            for name in keys & self._watched.keys():
                if (video := self._watched[name].video) is not None:
                    video.require_key()
            for name, watched in self._watched.items():
                self._look(name, watched, wants[name])

    def _has_news(self) -> bool:
        return self._awake_wants().keys() != self._watched.keys() or any(
            watched.camera.newest is not watched.taken for watched in self._watched.values()
        )

    def _awake_wants(self) -> Wants:
        """Return the wanted variants of the cameras that do not rest now."""
        now_s = time.monotonic()
        return {
            name: variants
            for name, variants in self._wants.items()
            if max(variants.values(), default=0.0) >= THUMBNAIL_HZ
            or now_s >= self._rest_until_s.get(name, float("-inf"))
        }

    def _follow(self, wants: Wants) -> None:
        """Subscribe and unsubscribe; on this thread, since it asks the robot."""
        for name in self._watched.keys() - wants.keys():
            self._watched.pop(name).camera.close()
        for name in wants.keys() - self._watched.keys():
            camera = Camera(self._sources[name], self._side, self._awake, lambda: self.clock)
            self._watched[name] = _Watched(camera)

    def _look(self, name: str, watched: _Watched, wants: Mapping[Variant, float]) -> None:
        arrival, now_s = watched.camera.newest, time.monotonic()
        is_new, watched.taken = arrival is not watched.taken, arrival
        if arrival is not None and is_new and (due := watched.due(wants, now_s)):
            picture = watched.camera.picture(arrival)
            if picture is not None:
                self._make(name, watched, picture, wants, due, now_s)
                self._rest_until_s[name] = now_s + 1.0 / max(wants.values())
        state = CameraState(name, watched.camera.refusal(now_s), watched.camera.warning(now_s))
        if state != watched.state:
            watched.state = state
            self._state(state)

    def _make(
        self,
        name: str,
        watched: _Watched,
        picture: CameraPicture,
        wants: Mapping[Variant, float],
        due: list[Variant],
        now_s: float,
    ) -> None:
        """Emit the unchanged picture, then the encoded variants."""
        if "full" in due:
            self._send(name, watched, picture, "full", picture.format, picture.encoded, now_s)
        if "small" in due or "video" in due:
            self._encode(name, watched, picture, due, now_s)
        elif not wants.keys() & {"small", "video"}:
            watched.camera.undecoded = None  # nobody wants decoded variants any more

    def _encode(
        self, name: str, watched: _Watched, picture: CameraPicture, due: list[Variant], now_s: float
    ) -> None:
        """Emit the picture as video and small. Imports the libraries here: the process starts faster."""
        from robots.bridge.camera.pictures.jpeg import decoded, small

        try:
            image = decoded(picture.encoded, VIDEO_WIDTH)
            if "video" in due:
                if watched.video is None:
                    from robots.bridge.camera.pictures.h264 import H264Encoder

                    watched.video = H264Encoder()
                unit, is_key = watched.video.encode(image)
                self._send(name, watched, picture, "video", "h264", unit, now_s, is_key=is_key)
        except Damaged as error:
            watched.camera.undecoded = damage_text(error)
            return
        watched.camera.undecoded = None
        if "small" in due:
            self._send(name, watched, picture, "small", "jpeg", small(image), now_s)

    def _send(
        self,
        name: str,
        watched: _Watched,
        picture: CameraPicture,
        variant: Variant,
        form: PictureFormat,
        encoded: bytes,
        now_s: float,
        *,
        is_key: bool = True,
    ) -> None:
        watched.made_s[variant] = now_s
        header = TakenPicture(
            name,
            variant,
            watched.number(variant),
            form,
            picture.width,
            picture.height,
            picture.age_s,
            is_key,
            picture.lens,
            picture.pose,
            picture.scale,
        )
        self._emit(header, encoded, picture.arrived_s)
