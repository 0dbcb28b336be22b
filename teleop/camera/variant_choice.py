"""Chooses the quality of a viewer's pictures by the speed of its acknowledgements. Pure.

A slow viewer first gets fewer pictures. If fewer than `LEAST_HZ` full pictures a second arrive, the viewer
gets video, if its browser can decode video. If video is too much as well, the viewer gets small pictures, and
fewer of them if necessary. Full pictures are tried again after some time, which doubles with each try. One
picture shows whether the connection is fast enough for full pictures.
JPEG quality and widths: `robots/bridge/camera/pictures/encoding.py`.
"""

from __future__ import annotations

from collections import deque

from robots.shared.wire import CameraSize, Variant

LEAST_HZ = 8.0
LEAST_VIDEO_HZ = 4.0  # with a long delay, fewer than `LEAST_HZ` arrive, and even fewer small pictures
WINDOW_S = 2.0  # over which the rate is measured
FEWEST_OFFERED = 10  # with fewer pictures in that time, a viewer cannot be judged
MOST_DAMAGED = 3  # video pictures in a row: then the browser cannot decode video
FULL_AGAIN_S = (8.0, 120.0)  # first and longest time until full pictures are tried again
MOST_UNACKNOWLEDGED = 2
SLOWEST_S = MOST_UNACKNOWLEDGED / LEAST_HZ  # from sending to acknowledgement, at the least rate
MOST_VIDEO_UNACKNOWLEDGED = 6  # a video picture is small, and each is needed


class Quality:
    """The variant for one viewer of one camera."""

    def __init__(self, size: CameraSize, video: bool, rate_hz: float, now_s: float) -> None:
        self.variant: Variant = "full" if size == "full" else "small"
        self._lower: Variant = "video" if video and size == "full" else "small"
        self._may_change = size == "full"
        self._wanted_hz = rate_hz
        self._since_s = now_s
        self._again_s = FULL_AGAIN_S[0]
        self._damaged = 0
        self._is_trying_full = False  # full pictures are tried again: the first one is not acknowledged yet
        self.has_failed = False  # the try took too long: then call `decide` at once
        self._offered: deque[float] = deque()  # when pictures arrived from the camera
        self._shown: deque[float] = deque()  # when pictures were acknowledged

    @property
    def most_unacknowledged(self) -> int:
        """Return the number of pictures that may be unacknowledged at once."""
        if self._is_trying_full:
            return 1
        return MOST_VIDEO_UNACKNOWLEDGED if self.variant == "video" else MOST_UNACKNOWLEDGED

    def offered(self, now_s: float) -> None:
        """Note that a picture of the present variant arrived from the camera."""
        self._offered.append(now_s)

    def acknowledged(self, now_s: float, sent_s: float) -> None:
        """Note that the viewer has painted a picture that was sent at `sent_s`."""
        self._shown.append(now_s)
        if self._is_trying_full and sent_s >= self._since_s:
            self._is_trying_full = False
            self.has_failed = now_s - sent_s > SLOWEST_S

    def unacknowledged(self, now_s: float, sent_s: float) -> None:
        """Note that the viewer has not yet painted a picture that was sent at `sent_s`."""
        self.has_failed |= self._is_trying_full and sent_s >= self._since_s and now_s - sent_s > SLOWEST_S

    def painted(self, *, damaged: bool) -> None:
        """Note whether the viewer could decode a picture."""
        self._damaged = self._damaged + 1 if damaged else 0

    def decide(self, now_s: float) -> bool:
        """Choose the variant; return whether it changed."""
        for times in (self._offered, self._shown):
            while times and times[0] < now_s - WINDOW_S:
                times.popleft()
        lasted_s = now_s - self._since_s
        if self.variant == "video" and self._damaged >= MOST_DAMAGED:
            self._lower = "small"
            self._change("small", now_s)
            return True
        if self.has_failed:
            self._change(self._lower, now_s)
            return True
        # Video needs more time: it arrives after the full pictures that still fill a slow connection, and
        # begins with a key picture.
        if not self._may_change or lasted_s < (2.0 * WINDOW_S if self.variant == "video" else WINDOW_S):
            return False
        if self.variant != "small" and self._is_slow:
            if self.variant == "full" and lasted_s > FULL_AGAIN_S[1]:
                self._again_s = FULL_AGAIN_S[0]
            self._change(self._lower if self.variant == "full" else "small", now_s)
            return True
        if self.variant != "full" and lasted_s > self._again_s and not self._is_slow:
            self._again_s = min(2.0 * self._again_s, FULL_AGAIN_S[1])
            self._change("full", now_s)
            self._is_trying_full = True
            return True
        return False

    @property
    def _is_slow(self) -> bool:
        """Return whether the viewer shows too few of the pictures that arrive from the camera."""
        if len(self._offered) < FEWEST_OFFERED:
            return False  # the camera itself is slow, or has just begun
        offered_hz, shown_hz = len(self._offered) / WINDOW_S, len(self._shown) / WINDOW_S
        least_hz = LEAST_VIDEO_HZ if self.variant == "video" else LEAST_HZ
        return shown_hz < min(least_hz, 0.8 * self._wanted_hz, 0.8 * offered_hz)

    def _change(self, variant: Variant, now_s: float) -> None:
        self.variant, self._since_s = variant, now_s
        self._is_trying_full = self.has_failed = False
        self._offered.clear()
        self._shown.clear()
