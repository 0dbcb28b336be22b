"""Encodes pictures as H.264 for slow connections. The camera process imports this module at its first use.

Used by `camera/producer.py`; `teleop/camera/variant_choice.py` chooses for each viewer. The names of formats are in
`robots/shared/wire/links/camera.py`, the decoder is in `static/js/camera/video.js`.
"""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import PIL.Image
from av.video.codeccontext import VideoCodecContext

from robots.bridge.camera.pictures.encoding import VIDEO_BITS_PER_S, VIDEO_HZ, VIDEO_KEY_EVERY, VIDEO_WIDTH
from robots.bridge.camera.pictures.image_header import Damaged
from robots.bridge.camera.pictures.jpeg import narrowed
from robots.shared.sentences import say


class H264Encoder:
    """H.264 of one camera (Annex B, baseline, one access unit for each picture). A new size begins a new stream."""

    def __init__(self) -> None:
        self._codec: VideoCodecContext | None = None
        self._count = 0
        self._wants_key = True

    def require_key(self) -> None:
        """Make the next picture decodable without earlier ones."""
        self._wants_key = True

    def encode(self, image: PIL.Image.Image) -> tuple[bytes, bool]:
        """Return the access unit of this picture, and whether it is a key picture. Raises `Damaged`."""
        fitted = narrowed(image, VIDEO_WIDTH)
        if self._codec is None or (self._codec.width, self._codec.height) != fitted.size:
            self._codec = _new_codec(*fitted.size)
            self._wants_key = True
        frame = av.VideoFrame.from_ndarray(np.asarray(fitted), format="rgb24").reformat(format="yuv420p")
        frame.pts = self._count
        if self._wants_key or self._count % VIDEO_KEY_EVERY == 0:
            frame.pict_type = av.video.frame.PictureType.I
        self._count += 1
        try:
            packets = self._codec.encode(frame)
        except av.FFmpegError as error:
            self._codec = None
            raise Damaged(say("cannot be made a video ({error})", error=str(error)[:100])) from error
        is_key = any(packet.is_keyframe for packet in packets)
        self._wants_key = self._wants_key and not is_key
        return b"".join(bytes(packet) for packet in packets), is_key


def _new_codec(width: int, height: int) -> VideoCodecContext:
    codec = av.CodecContext.create("libx264", "w")
    assert isinstance(codec, VideoCodecContext)  # noqa: S101  (for mypy)
    codec.width, codec.height, codec.pix_fmt = width, height, "yuv420p"
    codec.time_base, codec.framerate = Fraction(1, VIDEO_HZ), Fraction(VIDEO_HZ)
    codec.bit_rate = VIDEO_BITS_PER_S
    kbit_per_s = VIDEO_BITS_PER_S // 1000
    codec.thread_count = 1
    codec.options = {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "profile": "baseline",
        "forced-idr": "1",
        # A key picture must not be many times as large as other pictures: it would block a slow connection.
        "x264-params": f"keyint=infinite:scenecut=0:repeat-headers=1:vbv-maxrate={kbit_per_s}:vbv-bufsize=60",
    }
    return codec
