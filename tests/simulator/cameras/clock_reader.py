"""Reads the clock code of a picture."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from robots.simulator.cameras.clock_code import _AFTER, _BEFORE, BLOCKS, TICKS_PER_S, _parity


def read_clock(pixels: NDArray[np.uint8]) -> float | None:
    """Return the time in a picture (height, width, 3), in seconds modulo 2**32 / 10,000; None if there is no code."""
    side = pixels.shape[1] / BLOCKS
    middles = ((np.arange(BLOCKS) + 0.5) * side).astype(int)
    bits = (pixels[int(side / 2), middles].mean(axis=-1) > 127).astype(int).tolist()
    ticks, parity = _number(bits[2:34]), _number(bits[34:38])
    if (*bits[:2], *bits[38:]) != (*_BEFORE, *_AFTER) or parity != _parity(ticks):
        return None
    return ticks / TICKS_PER_S


def _number(bits: list[int]) -> int:
    return reduce(lambda number, bit: number << 1 | bit, bits, 0)
