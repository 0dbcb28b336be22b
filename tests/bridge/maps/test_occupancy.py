"""A robot's map becomes a picture in the right place; a bad map is refused."""

from __future__ import annotations

import math
import struct
import tracemalloc
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from robots.shared.maps.occupancy import MAX_MAP_SIDE, MAX_PICTURE_SIDE, MOST_CELLS, BadMap, taken

NORTH = (0.0, 0.0, math.sin(math.pi / 4.0), math.cos(math.pi / 4.0))
UNKNOWN, FREE, OCCUPIED = ((127, 135, 131, opacity) for opacity in (0, 34, 255))

# Row 0 is the lower edge: a corner of walls at the lower left, one free cell at the upper right.
CORNER = [
    [100, 100, 100],
    [100, 0, 0],
    [100, 0, -1],
    [-1, -1, 10],
]


def grid(
    cells=CORNER,
    *,
    resolution_m=0.05,
    origin=(-1.0, 2.0, 0.0),
    rotation=(0.0, 0.0, 0.0, 1.0),
    frame=b"map",
    size=None,
    count=None,
):
    """A serialized nav_msgs/OccupancyGrid."""
    percent = np.array(cells, np.int8)
    height, width = size or percent.shape
    return b"".join(
        (
            struct.pack("<IIII", 7, 1, 2, len(frame)),
            frame,
            struct.pack("<IIfII7d", 1, 2, resolution_m, width, height, *origin, *rotation),
            struct.pack("<I", percent.size if count is None else count),
            percent.tobytes(),
        )
    )


def pixels(taken_map):
    """Rows of the picture, the upper one first."""
    with Image.open(BytesIO(taken_map.picture)) as picture:
        picture.load()
        rgba = np.array(picture.convert("RGBA"))
    assert rgba.shape[:2] == (taken_map.height, taken_map.width)
    return [[tuple(pixel) for pixel in row] for row in rgba.tolist()]


def test_the_first_row_of_cells_is_the_lower_edge_of_the_picture():
    taken_map = taken(grid())
    upper, *_, lower = pixels(taken_map)
    assert lower == [OCCUPIED, OCCUPIED, OCCUPIED]
    assert upper == [UNKNOWN, UNKNOWN, FREE]
    assert (taken_map.resolution_m, taken_map.origin, taken_map.width, taken_map.height) == (
        0.05,
        (-1.0, 2.0, 0.0),
        3,
        4,
    )


def test_unknown_border_is_cropped_and_the_origin_moves():
    sheet = np.full((40, 60), -1)
    sheet[10:14, 20:23] = CORNER
    taken_map = taken(grid(sheet, origin=(5.0, 5.0, 0.0), rotation=NORTH))
    assert pixels(taken_map) == pixels(taken(grid()))
    # North is along the rows: 20 columns of 5 cm go north, 10 rows go west.
    assert taken_map.origin == pytest.approx((5.0 - 0.5, 5.0 + 1.0, math.pi / 2.0))


def test_large_map_is_thinned_and_thin_walls_stay():
    cells = np.zeros((3, 2 * MAX_PICTURE_SIDE), np.int8)
    cells[0, 5] = 100
    taken_map = taken(grid(cells))
    assert (taken_map.width, taken_map.height, taken_map.resolution_m) == (MAX_PICTURE_SIDE, 2, 0.1)
    upper, lower = pixels(taken_map)
    assert [index for index, pixel in enumerate(lower) if pixel == OCCUPIED] == [2]
    assert set(upper) == {FREE}


@pytest.mark.parametrize("size", [(1, MAX_MAP_SIDE), (MAX_MAP_SIDE, 1)])
def test_the_longest_map_is_thinned_within_little_memory(size):
    tracemalloc.start()
    try:
        taken_map = taken(grid(np.zeros(size, np.int8)))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert sorted((taken_map.width, taken_map.height)) == [1, MAX_PICTURE_SIDE]
    assert peak < 1024 * 1024


def test_digest_differs_for_a_door_or_a_shifted_map():
    door = [row.copy() for row in CORNER]
    door[0][1] = 0
    maps = [grid(), grid(), grid(door), grid(origin=(-1.0, 2.05, 0.0)), grid(rotation=NORTH)]
    first, again, *others = [taken(raw).digest for raw in maps]
    assert first == again
    assert len({first, *others}) == 4


def test_cells_neither_free_nor_occupied_are_unknown():
    assert pixels(taken(grid([[0, 50, -1, 101, -128, 100]]))) == [
        [FREE, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, OCCUPIED]
    ]


NAN = math.nan


@pytest.mark.parametrize(
    ("raw", "why"),
    [
        (b"", "incomplete"),
        (grid()[:40], "incomplete"),
        (grid()[:-1], "data for 12"),
        (grid() + b"x", "data for 12"),
        (grid(count=2**32 - 1), "data for 4294967295"),
        (grid(size=(4, 4)), "4 x 4 cells, but data for 12"),
        (grid(size=(0, 12)), "12 x 0 cells"),
        (grid(size=(2**32 - 1, 2**32 - 1)), "4294967295 x 4294967295 cells"),
        (grid(size=(MAX_MAP_SIDE, MOST_CELLS // MAX_MAP_SIDE + 1)), "1025 x 16384 cells$"),
        (grid(np.zeros((1, MAX_MAP_SIDE + 1))), "16385 x 1 cells$"),
        (grid(np.zeros((MAX_MAP_SIDE + 1, 1))), "1 x 16385 cells$"),
        (grid(resolution_m=NAN), "nan m wide"),
        (grid(resolution_m=0.0), "0.0 m wide"),
        (grid(resolution_m=-0.05), "m wide"),
        (grid(resolution_m=math.inf), "inf m wide"),
        (grid(origin=(NAN, 0.0, 0.0)), "its origin is nan"),
        (grid(origin=(0.0, math.inf, 0.0)), "its origin is 0.0, inf"),
        (grid(origin=(0.0, NAN, 0.0)), "its origin is 0.0, nan"),
        (grid(rotation=(0.0, 0.0, NAN, 1.0)), "its orientation is not finite"),
        (grid(rotation=(NAN, 0.0, 0.0, 1.0)), "its orientation is not finite"),
        (grid(rotation=(0.0, 0.0, 0.0, math.inf)), "its orientation is not finite"),
        (grid(rotation=(0.7071, 0.0, 0.0, 0.7071)), "not horizontal, but tilted by 90°"),
        (grid(rotation=(0.1, 0.0, 0.0, 2.0)), "not horizontal, but tilted by 6°"),
        (grid(rotation=(1.0, 0.0, 0.0, 0.0)), "tilted by 180°"),
        (grid(frame=b"odom"), "its frame is 'odom'"),
        (grid(frame=b"x" * 100_000), "its frame is 'xxx"),
        (grid(np.full((5, 5), -1)), "cells are unknown"),
    ],
)
def test_bad_map_is_refused_in_words(raw, why):
    with pytest.raises(BadMap, match=why) as refused:
        taken(raw)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize(
    "sent", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 7.0), (0.0, 0.0, 0.0, -1e-3), (1e-9,) * 4]
)
def test_a_zero_quaternion_is_no_rotation_and_any_length_will_do(sent):
    assert taken(grid(rotation=sent)).origin == pytest.approx(taken(grid()).origin)


@pytest.mark.parametrize("length", [0.1, 1.0, 40.0, -1.0])
def test_a_turned_map_is_turned_whatever_its_quaternions_length(length):
    half = math.radians(70.0) / 2.0
    turned = taken(grid(rotation=(0.0, 0.0, length * math.sin(half), length * math.cos(half))))
    assert turned.origin.yaw == pytest.approx(math.radians(70.0))


def test_an_old_publishers_slash_before_the_frame_means_nothing():
    assert taken(grid(frame=b"/map")).digest == taken(grid()).digest
