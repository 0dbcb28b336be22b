"""Play one case of the bench and print its trace, to find the reason of a crash."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.world.cases import (
    arm,
    clutter,
    crossing,
    doors,
    drawn,
    faults,
    leaving,
    navigation,
    objects,
    parked,
    walkers,
)
from benchmarks.world.controllers import CONTROLLERS
from benchmarks.world.loop import Case, Loop, Trace
from benchmarks.world.play import loop_of, recorded
from benchmarks.world.witness import seen


def main() -> int:
    """Return the exit status: 1 if the robot touched something."""
    parser = _parser()
    asked = parser.parse_args()
    if asked.record and (asked.controller != "gate" or asked.part == "walkers"):
        parser.error("only --controller gate can be recorded, in MuJoCo's world")
    if asked.part == "navigation":
        return _navigate(asked)
    if asked.part == "walkers":
        return _walk(asked)
    loop = loop_of(_case(asked), asked.controller, asked.seed)
    trace = recorded(loop, asked.record) if asked.record else loop.play()
    if not asked.quiet:
        _print_moments(trace)
    if asked.part == "drawn":
        print(drawn.job_of(asked.seed), drawn.words_of(asked.seed), sep="\n")
    _print_end(loop, trace)
    return 1 if trace.touches else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.world", description=__doc__)
    part = parser.add_subparsers(dest="part", required=True)
    thing = part.add_parser("object", help="full stick at one object")
    thing.add_argument("thing", choices=list(objects.OBJECTS))
    thing.add_argument("angle", type=int, choices=objects.ANGLES)
    thing.add_argument("share", type=float)
    thing.add_argument("--blanked", action="store_true", help="PAL's /scan in place of /scan_raw")
    thing.add_argument("--cold", action="store_true", help="the robot was parked there and knows nothing")
    thing.add_argument(
        "--once", action="store_true", help="the driver does not pull again after a refused reverse"
    )
    fault = part.add_parser("fault", help="full stick ahead while something fails")
    fault.add_argument("fault", choices=list(faults.FAULTS))
    fault.add_argument("thing", choices=faults.THINGS)
    fault.add_argument("share", type=float)
    door = part.add_parser("door", help="a competent driver passes a door")
    door.add_argument("width", type=float, choices=list(doors.DOORS))
    door.add_argument("--depth", default="640x480", help="size of the depth pictures, such as 96x72")
    door.add_argument(
        "--drawn", action="store_true", help="sensors, delays, brakes and wheels drawn by the seed"
    )
    person = part.add_parser("crossing", help="a person walks across the way")
    person.add_argument("share", type=float)
    part.add_parser("arm", help="the arm moves in the camera's view, then the robot drives")
    part.add_parser("drawn", help="one object, with sensors, delays, brakes and wheels drawn by the seed")
    close = part.add_parser("parked", help="turns to what it was parked close to, and drives off")
    close.add_argument("thing", choices=list(objects.OBJECTS))
    gone = part.add_parser("leaving", help="what stood in the way goes away")
    gone.add_argument("kind", choices=[leaving.CROSSED, *leaving.KINDS, *leaving.GLANCED])
    gone.add_argument("--ahead", action="store_true", help="in the end the stick goes away from it")
    gone.add_argument("--turns", action="store_true", help="in the end the robot turns around, to the place")
    minute = part.add_parser("clutter", help="a minute of adversarial stick in clutter")
    minute.add_argument(
        "--drawn", action="store_true", help="sensors, delays, brakes and wheels drawn by the seed"
    )
    way = part.add_parser("navigation", help="the robot drives itself to places, and the gate watches")
    way.add_argument(
        "--kind", choices=navigation.KINDS, default="good", help="how it plans, or who turns its head aside"
    )
    shins = part.add_parser("walkers", help="people on two shins, everything drawn by the seed")
    shins.add_argument("--still", action="store_true", help="the same room without people")
    for each in part.choices.values():
        each.add_argument("seed", type=int)
        each.add_argument("--controller", choices=list(CONTROLLERS), default="gate")
        each.add_argument("--quiet", action="store_true", help="only how it ends")
        each.add_argument("--record", type=Path, help="file for the gate's input, for manage.py replay_gate")
    return parser


def _case(asked: argparse.Namespace) -> Case:
    if asked.part == "object":
        job = objects.ObjectJob(
            asked.controller, asked.thing, asked.angle, asked.share, asked.seed, asked.blanked, asked.cold
        )
        return replace(objects.build(job), pulls_again=not asked.once)
    if asked.part == "fault":
        return faults.build(faults.Failing(asked.fault, asked.thing, asked.share, asked.seed))
    if asked.part == "drawn":
        return drawn.build(asked.seed)
    if asked.part == "arm":
        return arm.build(asked.seed)
    if asked.part == "parked":
        return parked.build(asked.thing, asked.seed)
    if asked.part == "leaving":
        return leaving.build(asked.kind, asked.seed, ahead=asked.ahead, turns=asked.turns)
    if asked.part == "door":
        columns, rows = asked.depth.split("x")
        return doors.build(asked.width, asked.seed, (int(columns), int(rows)), drawn=asked.drawn)
    if asked.part == "crossing":
        return crossing.build(asked.share, asked.seed)
    return clutter.build(asked.seed, drawn=asked.drawn)


def _navigate(asked: argparse.Namespace) -> int:
    loop = navigation.loop_of(asked.seed, asked.kind)
    trace = loop.play()
    print(*loop.interventions, sep="\n")
    print(f"{loop.arrived} goals, closest at rest {loop.closest_m:.3f} m")
    _print_touches(loop)
    print(f"{'CRASH' if trace.touches else 'clear'}, {trace.way_m:.2f} m in {trace.time_s:.1f} s")
    return 1 if trace.touches else 0


def _walk(asked: argparse.Namespace) -> int:
    run = walkers.run_of(
        walkers.Job(asked.seed, walkers.STILL if asked.still else walkers.WITH), asked.controller
    )
    ended = run.play()
    print(run.plan)
    for m in () if asked.quiet else ended.moments:
        print(
            f"{m.time_s:6.2f} at {m.pose.x:6.3f} {m.pose.y:6.3f} {math.degrees(m.pose.yaw):6.1f}  moves {m.mps:5.2f}"
            f"  sent {m.sent.vx:5.2f} {m.sent.w:5.2f}  gap {m.gap_m:6.3f}  {m.code} {m.text}"
        )
    if met := ended.met:
        cause = walkers.cause_of(met, run.plan) or "seen in time"
        print(f"{met.time_s:.2f} s: touches a {met.part} at {met.mps:.2f} m/s; {cause}")
    print(f"{'CRASH' if met else 'clear'}, {ended.way_m:.2f} m")
    return 1 if met else 0


def _print_moments(trace: Trace) -> None:
    for m in trace.moments:
        x, y, yaw = m.pose
        print(
            f"{m.time_s:6.2f}{'*' if m.trying else ' '} at {x:6.3f} {y:6.3f} {math.degrees(yaw):6.1f}"
            f"  moves {m.moving.vx:5.2f} {m.moving.w:5.2f}  asked {m.asked.vx:5.2f} {m.asked.w:5.2f}"
            f"  sent {m.sent.vx:5.2f} {m.sent.w:5.2f}  gap {m.gap_m:6.3f}  {m.code} {m.text}"
        )


def _print_touches(loop: Loop) -> None:
    for touch in loop.trace.touches:
        moving = f"{touch.robot.vx:.2f} m/s, {touch.robot.w:.2f} rad/s"
        known = seen(loop, touch) or "no sensor that can have seen it"
        print(f"{touch.time_s:.2f} s: {touch.part} touches {touch.other} at {moving}; seen by {known}")


def _print_end(loop: Loop, trace: Trace) -> None:
    _print_touches(loop)
    gap_m, ended = trace.moments[-1].gap_m, "CRASH" if trace.touches else "clear"
    print(f"{ended}, gap {gap_m:.3f} m, {trace.way_m:.2f} m in {trace.time_s:.1f} s")


if __name__ == "__main__":
    sys.exit(main())
