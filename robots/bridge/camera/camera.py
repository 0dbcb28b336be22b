"""One camera: the newest picture with its size, lens, pose and age, or why there is none."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from robots.bridge.camera.camera_side import CameraSide, Unreadable
from robots.bridge.camera.lens import CameraInfo, Lens, Misfit, lens_of
from robots.bridge.camera.picture_age import PictureAge
from robots.bridge.camera.pictures.image_header import Damaged
from robots.bridge.camera.pictures.shown import compressed_picture, raw_picture
from robots.bridge.robot.board import BOARD
from robots.bridge.robot.sensors.frames import PoseUnknown
from robots.bridge.robot_clock import RobotClock
from robots.shared.configuration.bridge_config import CameraSource
from robots.shared.sentences import say
from robots.shared.texts import NAME, cut
from robots.shared.wire import PictureFormat, PictureScale, Refusal

SILENT_S = 2.0
MOST_WORDS = 200  # characters: frames may have long names
WITHOUT_PLACE_S = 3.0  # if nothing can be drawn into the pictures for this time, a warning gives the reason
POSE_LATE_S = 0.15  # tf for a picture's stamp arrives after the picture: a pose older by at most this is used
_STAMP_END = (
    12  # bytes of a message up to the end of its stamp, in ROS 1 and in ROS 2: four come before the stamp
)


class Arrival(NamedTuple):
    """A message as it arrived."""

    message: Any  # as its side has it
    wall_s: float
    arrived_s: float  # monotonic clock


class CameraPicture(NamedTuple):
    """One encoded picture, with all data that a page needs."""

    encoded: bytes
    format: PictureFormat
    width: int
    height: int
    age_s: float  # on arrival
    arrived_s: float
    lens: Lens | None
    pose: tuple[float, ...] | None
    scale: PictureScale | None  # of depth and heat


class Camera:
    """Subscribes to one camera. `awake` is notified of each picture, on the threads of the side.

    `clock` returns the robot's clock as it is known now.
    """

    def __init__(
        self,
        source: CameraSource,
        side: CameraSide,
        awake: threading.Condition,
        clock: Callable[[], RobotClock] = RobotClock,
    ) -> None:
        self.source = source
        self._side = side
        self._awake = awake
        self._clock = clock
        self._age = PictureAge()
        self.newest: Arrival | None = None  # message
        self._info: CameraInfo | None = None
        self._told = b""  # the last camera info without its number and stamp
        self._damage: str | None = None  # of the last picture
        self.undecoded: str | None = None  # why the last picture that had to be decoded could not be decoded
        # Why nothing can be drawn into the pictures: code and words.
        self._misfit: tuple[str, str] | None = None
        self._placed_s = time.monotonic()  # when the camera's pose was known last
        self._began_s = time.monotonic()
        self._subscription = side.listen(
            source, self._on_picture, self._on_info, lambda: self._info is not None
        )

    def close(self) -> None:
        """Unsubscribe."""
        self._subscription.close()

    # --- on the threads of the side ----------------------------------------------------------------

    def _on_picture(self, message: Any) -> None:
        arrival = Arrival(message, time.time(), time.monotonic())
        with self._awake:
            self.newest = arrival
            self._awake.notify()

    def _on_info(self, raw: bytes) -> None:
        told = raw[_STAMP_END:]
        if told == self._told:
            return  # most camera infos differ only in their stamp
        self._told = told
        try:
            self._info = self._side.read_info(raw)
        except Unreadable:
            self._info = None

    # --- on the producer's thread --------------------------------------------------------------------

    def picture(self, arrival: Arrival) -> CameraPicture | None:
        """Return the picture of this message, a raw one as JPEG; None if it cannot be shown (see `refusal`)."""
        try:
            picture = self._picture(arrival)
        except Damaged as error:
            self._damage = damage_text(error)
            return None
        except Unreadable:
            self._damage = say("The camera’s messages cannot be read.")
            return None
        self._damage = None
        return picture

    def _picture(self, arrival: Arrival) -> CameraPicture:
        kind = self._side.type_of(arrival.message)
        if kind != self.source.type:
            raise Damaged(
                say(
                    "is of another type than in the profile ({type}, not {wanted})",
                    type=cut(kind, NAME),
                    wanted=self.source.type,
                )
            )
        stamp_s, frame, message = self._side.read(arrival.message)
        if kind.endswith("/CompressedImage"):
            shown = compressed_picture(bytes(message.data), message.format, self.source.topic)
        else:
            shown = raw_picture(message, self.source.topic)
        encoded, form, width, height, scale = shown
        frame = self.source.frame or frame.lstrip("/")
        age_s = self._age.on_arrival(stamp_s, arrival.wall_s, arrival.arrived_s, self._clock())
        lens = self._lens(width, height)
        pose = self._pose(frame, stamp_s) if lens else None
        if pose is not None:
            self._placed_s = arrival.arrived_s
        return CameraPicture(encoded, form, width, height, age_s, arrival.arrived_s, lens, pose, scale)

    def _lens(self, width: int, height: int) -> Lens | None:
        """Return the lens for pictures of this size; None without a camera info that fits them."""
        if self._info is None:
            self._misfit = (
                "no_camera_info",
                say("its lens is not known (no camera info comes on {topic})", topic=self.source.info),
            )
            return None
        try:
            lens = lens_of(self._info, width, height, self.source.topic)
        except Misfit as error:
            self._misfit = (
                "bad_camera_info",
                say("{error} (camera info on {topic})", error=error, topic=self.source.info),
            )
            return None
        self._misfit = None
        return lens

    def _pose(self, frame: str, stamp_s: float) -> tuple[float, ...] | None:
        """Return the base frame's pose in the optical frame, 3 x 4 row by row; None if tf has no pose."""
        try:
            to_base = self._side.frames.pose_at(frame, stamp_s, patience_s=0.0, late_s=POSE_LATE_S)
        except PoseUnknown as unknown:
            why = say("where it is on the robot is not known ({error})", error=unknown)
            self._misfit = ("no_camera_place", why)
            return None
        turned = to_base[:3, :3].T
        origin = -turned @ to_base[:3, 3]
        return tuple(round(float(number), 5) for row in range(3) for number in (*turned[row], origin[row]))

    def warning(self, now_s: float) -> Refusal | None:
        """Return why nothing could be drawn into the pictures for `WITHOUT_PLACE_S`; None: no reason.

        Without pictures, or if the profile names no camera info, it is None too.
        """
        newest = self.newest
        comes = newest is not None and now_s - newest.arrived_s < SILENT_S and self._damage is None
        if (
            not self.source.info
            or self._misfit is None
            or not comes
            or now_s - self._placed_s < WITHOUT_PLACE_S
        ):
            return None
        code, why = self._misfit
        text = say("The robot’s way is not drawn into the camera’s picture: {why}.", why=why)
        return Refusal(code, text, "robot", {"topic": self.source.topic})

    def refusal(self, now_s: float) -> Refusal | None:
        """Return why no pictures come; None while they come, and in the first `SILENT_S`."""
        topic = self.source.topic
        figures = {"topic": topic}
        if why := BOARD.text(topic):
            return Refusal("too_much", why, "robot", figures)
        newest = self.newest
        since_s = now_s - (newest.arrived_s if newest else self._began_s)
        if since_s > SILENT_S:
            if not self._subscription.publishers:
                text = "The camera is off: the robot sends no pictures of it."
                return Refusal("no_publisher", text, "robot", figures)
            text = say("The camera has sent no picture for {seconds:.0f} s.", seconds=since_s)
            return Refusal("camera_silent", text, "robot", {**figures, "silent_s": round(since_s)})
        damage = self._damage or self.undecoded
        if damage is not None:
            return Refusal("bad_picture", damage, "robot", figures)
        return None


def damage_text(error: Damaged) -> str:
    """Return in words that a picture cannot be shown."""
    return say("The camera’s picture {error}.", error=error)
