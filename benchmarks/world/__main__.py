"""Play one case of the bench and print its trace: for whoever looks for the reason of a crash."""

from __future__ import annotations

import argparse
import math
import sys

from benchmarks.world import objects
from benchmarks.world.controllers import CONTROLLERS
from benchmarks.world.loop import Case, Trace
from benchmarks.world.play import loop_of


def main() -> int:
    """Returns 1 if the robot touched something."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.world", description=__doc__)
    parser.add_argument("thing", choices=list(objects.OBJECTS))
    parser.add_argument("angle", type=int, choices=objects.ANGLES)
    parser.add_argument("share", type=float)
    parser.add_argument("seed", type=int)
    parser.add_argument("--controller", choices=list(CONTROLLERS), default="gate")
    parser.add_argument("--blanked", action="store_true", help="PAL's /scan in place of /scan_raw")
    parser.add_argument("--quiet", action="store_true", help="only how it ends")
    asked = parser.parse_args()
    full = objects.Full(asked.controller, asked.thing, asked.angle, asked.share, asked.seed, asked.blanked)
    return show(objects.build(full), asked.controller, asked.seed, quiet=asked.quiet)


def show(case: Case, controller: str, seed: int, *, quiet: bool) -> int:
    """Play and print."""
    trace = loop_of(case, controller, seed).play()
    if not quiet:
        _print_moments(trace)
    for touch in trace.touches:
        moving = f"{touch.robot.vx:.2f} m/s, {touch.robot.w:.2f} rad/s"
        print(f"{touch.time_s:.2f} s: {touch.part} touches {touch.other} at {moving}")
    gap_m, ended = trace.moments[-1].gap_m, "CRASH" if trace.touches else "clear"
    print(f"{ended}, gap {gap_m:.3f} m, {trace.way_m:.2f} m in {trace.time_s:.1f} s")
    return 1 if trace.touches else 0


def _print_moments(trace: Trace) -> None:
    for m in trace.moments:
        x, y, yaw = m.pose
        print(
            f"{m.time_s:6.2f}{'*' if m.trying else ' '} at {x:6.3f} {y:6.3f} {math.degrees(yaw):6.1f}"
            f"  moves {m.moving.vx:5.2f} {m.moving.w:5.2f}  asked {m.asked.vx:5.2f} {m.asked.w:5.2f}"
            f"  sent {m.sent.vx:5.2f} {m.sent.w:5.2f}  gap {m.gap_m:6.3f}  {m.code} {m.text}"
        )


if __name__ == "__main__":
    sys.exit(main())
