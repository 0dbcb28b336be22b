"""Work that repeats runs in step, so that one wake-up of a process serves all of it. Pure: time is an argument."""


def next_step(now_s: float, pace_s: float) -> float:
    """Return the next time of all work at this pace."""
    return (now_s // pace_s + 1.0) * pace_s
