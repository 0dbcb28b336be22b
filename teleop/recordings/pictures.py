"""Recorded pictures as browsers show them."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import PIL.Image

from robots.shared.wire import NotDone, Refusal

_MODES = {
    "rgb8": "RGB",
    "bgr8": "RGB",
    "rgba8": "RGBA",
    "bgra8": "RGBA",
    "mono8": "L",
    "8UC1": "L",
    "8UC3": "RGB",
}
_DEEP = {"mono16": "u2", "16UC1": "u2", "32FC1": "f4"}
_NO_PICTURE = Refusal("bad_picture", "This picture cannot be shown: its encoding is not known.", "robot")


def encoded(message: Any) -> tuple[str, bytes]:
    """Return media type and bytes of a sensor_msgs/CompressedImage or sensor_msgs/Image. Raises `NotDone`."""
    data = bytes(message.data)
    if hasattr(message, "format"):
        for mark, kind in ((b"\xff\xd8", "image/jpeg"), (b"\x89PNG", "image/png")):
            if data.startswith(mark):
                return kind, data
        raise NotDone(_NO_PICTURE)
    try:
        image = _image(message, data)
    except (ValueError, KeyError, AttributeError) as error:
        raise NotDone(_NO_PICTURE) from error
    packed = io.BytesIO()
    image.convert("RGB").save(packed, "JPEG", quality=85)
    return "image/jpeg", packed.getvalue()


def _image(message: Any, data: bytes) -> PIL.Image.Image:
    size, encoding = (message.width, message.height), message.encoding
    if encoding in _DEEP:
        rows = np.frombuffer(data, np.uint8).reshape(message.height, message.step)
        kind = (">" if message.is_bigendian else "<") + _DEEP[encoding]
        width = message.width * np.dtype(kind).itemsize
        values = np.ascontiguousarray(rows[:, :width]).view(kind).astype(np.float32)
        valid = values[np.isfinite(values) & (values > 0)]
        low, high = np.percentile(valid, (2, 98)) if len(valid) else (0.0, 1.0)
        shares = np.clip((np.nan_to_num(values) - low) / max(high - low, 1e-9), 0, 1)
        return PIL.Image.fromarray((shares * 255).astype(np.uint8))
    mode = _MODES[encoding]
    order = {"bgr8": "BGR", "8UC3": "BGR", "bgra8": "BGRA"}.get(encoding, mode)
    return PIL.Image.frombuffer(mode, size, data, "raw", order, message.step, 1)
