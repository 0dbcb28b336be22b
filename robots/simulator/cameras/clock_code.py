"""A code of the monotonic time in a picture, so that a picture on a page shows when it was taken.

The code is a row of 40 blocks along the top edge (16 x 16 pixels in a picture 640 pixels wide): white, black,
32 bits of time (0.1 ms since the start of CLOCK_MONOTONIC, most significant first, modulo 2**32), 4 bits of
parity, black, white. A white block is a one. The parity is the exclusive or of the eight groups of four bits,
and of 1010. The blocks are readable after JPEG or H.264, also at half the size;
benchmarks/views/camera_page.py reads them from a canvas.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import NDArray

BLOCKS = 40
TICKS_PER_S = 10_000
_TIME_BITS = 32
_BEFORE, _AFTER = (1, 0), (0, 1)


def draw_clock(pixels: NDArray[np.uint8], monotonic_s: float) -> None:
    """Draw the code of a time into a picture (height, width, 3); its width is a multiple of 40."""
    side = pixels.shape[1] // BLOCKS
    ticks = round(monotonic_s * TICKS_PER_S) % 2**_TIME_BITS
    code = np.array((*_BEFORE, *_bits(ticks, _TIME_BITS), *_bits(_parity(ticks), 4), *_AFTER), dtype=np.uint8)
    pixels[:side] = np.repeat(code * 255, side)[None, :, None]


def _parity(ticks: int) -> int:
    return reduce(lambda parity, shift: parity ^ (ticks >> shift) & 0b1111, range(0, _TIME_BITS, 4), 0b1010)


def _bits(number: int, count: int) -> list[int]:
    return [number >> place & 1 for place in reversed(range(count))]
