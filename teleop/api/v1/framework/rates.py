"""Limits of requests: how often one program or browser may ask this process, how many may wait at once."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock, Semaphore

from robots.shared.link.flood_limits import TokenBucket
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem

PER_S = 200.0  # on average; a lab's dashboard sends a tenth of that
BURST = 400.0
MOST = 10_000  # programs and browsers that are counted: those with the latest requests

TOO_OFTEN = Refusal(
    "too_often",
    say("At most {most:.0f} requests a second are taken: wait a moment.", most=PER_S),
    "wire",
    {"per_s": PER_S},
)
_buckets: OrderedDict[str, TokenBucket] = OrderedDict()


@contextmanager
def place_in(places: Semaphore | Lock, full: Refusal) -> Iterator[None]:
    """Context: hold one of these places. Raises `Problem` with the refusal `full`, without waiting, if none is free."""
    if not places.acquire(blocking=False):
        raise Problem(full)
    try:
        yield
    finally:
        places.release()


POLICY = f'"client";q={BURST:.0f};w={BURST / PER_S:.0f}'  # header RateLimit-Policy


def headers_of(key: str) -> dict[str, str]:
    """Return the headers with the limit, and with what a token or session has left (IETF draft RateLimit)."""
    bucket = _buckets.get(key)
    left = bucket.left(time.monotonic()) if bucket else BURST
    return {
        "RateLimit-Policy": POLICY,
        "RateLimit": f'"client";r={left:.0f};t={(BURST - left) / PER_S:.0f}',
    }


def asks_too_often(key: str) -> bool:
    """Count a request of a token or session, and return whether it exceeds the rate."""
    bucket = _buckets.setdefault(key, TokenBucket(PER_S, BURST))
    _buckets.move_to_end(key)
    while len(_buckets) > MOST:
        _buckets.popitem(last=False)
    return not bucket.spend(time.monotonic())
