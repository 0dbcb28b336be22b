"""Convert a nav_msgs/OccupancyGrid to a small picture. Pure: numpy and the standard library.

Implausible numbers from the robot raise `BadMap`, with a text for the log.
"""

from __future__ import annotations

import hashlib
import math
import struct
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.shared.geometry.poses import Pose
from robots.shared.geometry.quaternions import rotation
from robots.shared.records.record_sink import TakenMap
from robots.shared.sentences import say

MOST_CELLS = 4096 * 4096
MAX_PICTURE_SIDE = 2048  # cells of the picture; larger maps are thinned
# limit of a map's side: a long thin map is padded to whole blocks before thinning
MAX_MAP_SIDE = 8 * MAX_PICTURE_SIDE
MAX_FRAME_NAME = 200  # characters of the frame's name
FRAME = "map"  # REP 105: the bridge knows the pose of the odometry frame in this frame
FREE_TO, OCCUPIED_FROM = 25, 65  # percent, thresholds of map_server
UNKNOWN, FREE, OCCUPIED = 0, 1, 2
# Greys for light and dark pages: the floor is a shade of the page's colour, obstacles have full contrast.
_COLOURS = bytes((127, 135, 131)) * 3
_OPACITY = bytes((0, 34, 255))
_FARTHEST_M = 1e5
_SIGNATURE_BYTES = 8  # of a PNG
_TILT = 0.04  # rad: a map must be horizontal

_HEADER = struct.Struct("<III")  # number, seconds, nanoseconds
_LENGTH = struct.Struct("<I")
_INFO = struct.Struct("<IIfII7d")  # load time, resolution, width, height, origin
LARGEST_MESSAGE = _HEADER.size + 2 * _LENGTH.size + MAX_FRAME_NAME + _INFO.size + MOST_CELLS

Cells = NDArray[np.uint8]  # UNKNOWN, FREE or OCCUPIED; row 0 is the lower edge


class BadMap(ValueError):
    """The message is no usable map; the text is the reason."""


class _Geometry(NamedTuple):
    """Position of the cells: `origin` is the outer corner of the first one."""

    resolution_m: float
    origin: Pose

    def from_cell(self, column: int, row: int) -> _Geometry:
        """Return the geometry with this cell as the first one."""
        x, y, yaw = self.origin
        along, up = column * self.resolution_m, row * self.resolution_m
        c, s = math.cos(yaw), math.sin(yaw)
        return self._replace(origin=Pose(x + c * along - s * up, y + s * along + c * up, yaw))


def taken(raw: bytes) -> TakenMap:
    """Return the map of a message of ROS 1, cropped to its known part. Raises `BadMap`."""
    try:
        (length,) = _LENGTH.unpack_from(raw, _HEADER.size)
        at = _HEADER.size + _LENGTH.size
        frame = raw[at : at + min(length, MAX_FRAME_NAME)].decode(errors="replace").lstrip("/")
        info = _INFO.unpack_from(raw, at + length)
        at += length + _INFO.size
        (count,) = _LENGTH.unpack_from(raw, at)
    except struct.error as error:
        raise BadMap(say("the message is incomplete")) from error
    _, _, resolution_m, width, height, *origin = info
    return taken_from(frame, resolution_m, width, height, origin, count, memoryview(raw)[at + _LENGTH.size :])


def taken_from(
    frame: str,
    resolution_m: float,
    width: int,
    height: int,
    origin: Sequence[float],
    count: int,
    data: memoryview,
) -> TakenMap:
    """Return the map with these fields of a message, and its `count` cells, cropped to its known part.

    `origin`: position and quaternion. Raises `BadMap`.
    """
    if frame != FRAME:
        raise BadMap(say("its frame is {frame}, not {map}", frame=repr(frame), map=repr(FRAME)))
    if not width or not height or max(width, height) > MAX_MAP_SIDE or width * height > MOST_CELLS:
        raise BadMap(say("it has {width} x {height} cells", width=width, height=height))
    if count != width * height or len(data) != count:
        raise BadMap(
            say(
                "it has {width} x {height} cells, but data for {count}",
                width=width,
                height=height,
                count=count,
            )
        )
    percent = np.frombuffer(data, np.int8, count).reshape(height, width)
    return _reduced(_geometry(resolution_m, *origin), _classified(percent))


def of_percents(resolution_m: float, origin: Pose, percent: NDArray[np.int8]) -> TakenMap:
    """Return the map with these cells, row 0 at the lower edge: the same as `taken` returns for a message."""
    return _reduced(_Geometry(resolution_m, origin), _classified(percent))


def _reduced(geometry: _Geometry, cells: Cells) -> TakenMap:
    geometry, cells = _cut(geometry, cells)
    geometry, cells = _thinned(geometry, cells)
    height, width = cells.shape
    geometry_bytes = struct.pack("<dddd2I", geometry.resolution_m, *geometry.origin, width, height)
    return TakenMap(
        resolution_m=geometry.resolution_m,
        origin=geometry.origin,
        width=width,
        height=height,
        picture=_png(np.flipud(cells)),
        digest=hashlib.sha256(geometry_bytes + cells.tobytes()).hexdigest(),
    )


def cells_of(taken: TakenMap) -> Cells:
    """Return the cells of a map that `taken` has made, row 0 at the lower edge."""
    at, packed = _SIGNATURE_BYTES, b""
    while at < len(taken.picture):
        (length,) = struct.unpack_from(">I", taken.picture, at)
        if taken.picture[at + 4 : at + 8] == b"IDAT":
            packed += taken.picture[at + 8 : at + 8 + length]
        at += length + 12
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(taken.height, taken.width + 1)
    return np.flipud(rows[:, 1:])


def _geometry(
    resolution_m: float, x: float, y: float, z: float, qx: float, qy: float, qz: float, qw: float
) -> _Geometry:
    if not 0.001 <= resolution_m <= 10.0:
        raise BadMap(say("its cells are {width} m wide", width=resolution_m))
    if not (abs(x) <= _FARTHEST_M and abs(y) <= _FARTHEST_M):
        raise BadMap(say("its origin is {x}, {y}", x=x, y=y))
    turn = rotation(qx, qy, qz, qw)
    if turn is None:
        raise BadMap(say("its orientation is not finite"))
    if turn.tilt > _TILT:
        raise BadMap(say("it is not horizontal, but tilted by {tilt:.0f}°", tilt=math.degrees(turn.tilt)))
    # The message has single precision: 0.05000000074505806 stands for 0.05.
    return _Geometry(float(f"{resolution_m:.6g}"), Pose(x, y, turn.yaw))


def _classified(percent: NDArray[np.int8]) -> Cells:
    cells = np.full(percent.shape, UNKNOWN, np.uint8)
    cells[(percent >= 0) & (percent <= FREE_TO)] = FREE
    cells[(percent >= OCCUPIED_FROM) & (percent <= 100)] = OCCUPIED
    return cells


def _cut(geometry: _Geometry, cells: Cells) -> tuple[_Geometry, Cells]:
    """Crop unknown rows and columns at the edges: SLAM begins with a large sheet."""
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    if not rows.size:
        raise BadMap(say("all its cells are unknown"))
    kept = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return geometry.from_cell(int(columns[0]), int(rows[0])), kept


def _thinned(geometry: _Geometry, cells: Cells) -> tuple[_Geometry, Cells]:
    """Merge cells if there are too many. A merged cell is a wall if one of them is; else free if one is."""
    share = -(-max(cells.shape) // MAX_PICTURE_SIDE)
    if share == 1:
        return geometry, cells
    height, width = cells.shape
    filled = np.pad(cells, ((0, -height % share), (0, -width % share)))
    blocks = filled.reshape(filled.shape[0] // share, share, filled.shape[1] // share, share)
    return geometry._replace(resolution_m=geometry.resolution_m * share), blocks.max(axis=(1, 3))


def _png(rows: Cells) -> bytes:
    """Encode a picture in three colours, its first row on top."""
    height, width = rows.shape
    unfiltered = np.pad(rows, ((0, 0), (1, 0))).tobytes()  # each row begins with its filter number: none
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
            _chunk(b"PLTE", _COLOURS),
            _chunk(b"tRNS", _OPACITY),
            _chunk(b"IDAT", zlib.compress(unfiltered, 9)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
