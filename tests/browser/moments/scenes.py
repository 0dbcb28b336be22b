"""Moments of a drive: what a driving page hears, made from the wire's own structs, and a camera's picture."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec
import numpy as np
import PIL.Image

from robots.shared import wire
from robots.shared.wire.base import PendingStop
from robots.shared.wire.navigation import GoEnd, GoProgress, Location
from robots.shared.wire.state import (
    MotionOffer,
    MovesAlthoughStopped,
    NeutralNeeded,
    Odometry,
    Scan,
    Sensor,
    SpeedLimit,
    State,
    StopState,
    Verdict,
)

STILL = (0.0, 0.0, 0.0)
WALL_M = 0.62  # from the middle of the base
LIMITS = [
    SpeedLimit("blind_direction", "at most 0.1 m/s in reverse: no sensor looks there", 0.1, "reverse"),
    SpeedLimit("depth_stale", "at most 0.3 m/s: the depth camera's last picture is 1.2 s old", 0.3),
]
WALL = Verdict(
    "obstacle",
    "stopped (0.4 m/s asked): laser, 0.1 m ahead",
    (0.4, 0.0, 0.0),
    STILL,
    sensor="laser",
    distance_m=0.1,
    bearing_rad=0.0,
    side="ahead",
    point=(WALL_M, 0.05),
    limits=LIMITS,
)
IDLE = Verdict("idle", "", STILL, STILL, limits=LIMITS)
READY = State(
    phase="online",
    text="",
    stop=StopState("clear"),
    verdict=IDLE,
    odometry=Odometry(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    sensors=[
        Sensor("base_scan", "scan", True, 0.0),
        Sensor("odom", "odometry", True, 0.0),
        Sensor("xtion", "depth", True, 0.1),
    ],
    battery_percent=86.0,
    charging=False,
    holder=None,
    fence=None,
    seq=None,
    neutral_needed=None,
    foreign=[],
    watchers=["Olga Operator"],
    clock_skew_s=None,
    refused={},
    latency_s=0.11,
    latency_measured=True,
    unseen_s=0.0,
    stands=True,
    location=Location(2.0, 1.8, 0.0, 0.05, 0.04, 0.0, 0.02, 0.3),
)
FREE = wire.Control("free")
MINE = wire.Control("yours", holder="Olga Operator", fence=7, session="s", remaining_s=251.0, may_clear=True)


@dataclass(frozen=True)
class Moment:
    """One moment: the console's messages to a page, and the person's own part.

    `gone`: the console has lost the bridge. `silent`: the console says nothing more. `cut`: the page has no socket.
    `keys`: held by the person. `mapped`: the map is open. `before`: an earlier state. `points`: the person presses on
    the floor behind the wall in the camera's picture.
    """

    name: str
    state: State = READY
    control: wire.Control = MINE
    gone: wire.BridgeGone | None = None
    silent: bool = False
    cut: bool = False
    keys: str = ""
    mapped: bool = False
    points: bool = False
    before: State | None = None


def _held(verdict: Verdict, **more: Any) -> State:
    return msgspec.structs.replace(READY, verdict=verdict, **more)


GOING = GoProgress(4, "Olga Operator", 5.0, 2.0, 0.0, 2.9, 4.0, place="Kitchen")
MOMENTS = [
    Moment("ready", control=FREE),
    Moment("held before a wall", _held(WALL)),
    Moment("robot froze", msgspec.structs.replace(READY, unseen_s=4.2, stands=None)),
    Moment(
        "robot out of reach",
        msgspec.structs.replace(
            READY, phase="waiting", text="No ROS master at http://tiago-1:11311 [Errno 111]", unseen_s=14.0
        ),
    ),
    Moment(
        "bridge gone",
        gone=wire.BridgeGone(wire.Refusal("bridge_gone", "The robot's bridge is not running.", "robot")),
    ),
    Moment("console silent", silent=True),
    Moment("no connection", cut=True),
    Moment(
        "stopped by another",
        msgspec.structs.replace(READY, stop=StopState("stopped", "Bo Berg", standstill_ms=412.0, number=3)),
    ),
    Moment(
        "moves although stopped",
        msgspec.structs.replace(
            READY,
            stop=StopState("stopped", "Bo Berg", number=3),
            stands=False,
            moves_although_stopped=MovesAlthoughStopped(
                2.0,
                ["base"],
                0.3,
                0.0,
                {"/cmd_vel": ["/rogue"]},
                "It drives at 0.3 m/s. Velocities for its base come from /rogue on /cmd_vel.",
            ),
        ),
    ),
    Moment(
        "stop not confirmed",
        gone=wire.BridgeGone(
            wire.Refusal("bridge_gone", "The robot's bridge is not running.", "robot"),
            stop=PendingStop("Bo Berg", "", 1_790_000_000.0),
        ),
    ),
    Moment("stick without control", control=FREE, keys="w"),
    Moment(
        "navigation held back",
        msgspec.structs.replace(
            READY, going_ended=GoEnd(4, 1, 7, "held_back", "held back: laser, 0.1 m ahead", "obstacle", 1.4)
        ),
        before=msgspec.structs.replace(READY, going=GOING),
    ),
    Moment(
        "drives itself",
        _held(
            Verdict("free", "", (0.3, 0.0, 0.1), (0.3, 0.0, 0.1), limits=LIMITS), going=GOING, stands=False
        ),
        mapped=True,
    ),
    Moment(
        "driving, all well",
        _held(Verdict("free", "", (0.4, 0.0, 0.0), (0.4, 0.0, 0.0), limits=LIMITS[:1]), stands=False),
        keys="w",
    ),
    Moment("pointed behind the wall", points=True),
    Moment(
        "stick must rest",
        msgspec.structs.replace(READY, neutral_needed=NeutralNeeded("stop_cleared", "the stop was cleared")),
        keys="w",
    ),
]


MOTIONS = [
    MotionOffer(name, name.replace("_", " ").capitalize(), duration_s=4.0)
    for name in ("home", "wave", "shake_hands", "offer", "open_hand")
]


def scan() -> Scan:
    """A wall ahead, walls left and right, a chair seen earlier."""
    wall = [(WALL_M, y / 20) for y in range(-50, 51)]
    left = [(x / 20, 2.5) for x in range(-60, 13)]
    right = [(x / 20, -2.5) for x in range(-60, 13)]
    flat = [round(100 * v) for point in (*wall, *left, *right) for v in point]
    chair = [round(100 * v) for a in range(8) for v in (-0.2 + 0.2 * math.cos(a), 1.2 + 0.2 * math.sin(a))]
    return Scan(laser_cm=flat, sonar_cm=[], remembered_cm=chair, unseen=[(2.0, 4.28)])


HEIGHT_M, PITCH_RAD, FOCAL_PX, WIDTH, HEIGHT = 1.1, 0.35, 522.0, 640, 480


@cache
def picture() -> bytes:
    """A camera's frame: tiles of a floor, a wall with a door, by rays through each pixel."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    right, down = (u - WIDTH / 2) / FOCAL_PX, (v - HEIGHT / 2) / FOCAL_PX
    cos, sin = math.cos(PITCH_RAD), math.sin(PITCH_RAD)
    x, y, z = cos - sin * down, -right, -sin - cos * down
    with np.errstate(divide="ignore", invalid="ignore"):
        floor_x, floor_y = -HEIGHT_M * x / z, -HEIGHT_M * y / z
        wall_y, wall_z = 2.2 * y / x, HEIGHT_M + 2.2 * z / x
    floor = (z < 0) & (floor_x < 2.2)
    tiles = (np.floor(floor_x / 0.4) + np.floor(floor_y / 0.4)) % 2
    grey = np.where(floor, 150 + 25 * tiles, 225 - 30 * (np.abs(wall_y) > 1.6))
    door = ~floor & (np.abs(wall_y + 0.7) < 0.45) & (wall_z < 2.0)
    rgb = np.stack([grey, grey - 4 * floor, grey - 12], axis=-1)
    rgb[door] = (150, 110, 70)
    file = io.BytesIO()
    PIL.Image.fromarray(rgb.clip(0, 255).astype(np.uint8)).save(file, "JPEG", quality=85)
    return file.getvalue()


def camera_frame(number: int, taken_ms: float) -> bytes:
    """A picture with its header, as the console sends it."""
    cos, sin = math.cos(PITCH_RAD), math.sin(PITCH_RAD)
    # rows: right, down, into the picture; the lens is HEIGHT_M above the base's origin
    pose = (0.0, -1.0, 0.0, 0.0, -sin, 0.0, -cos, cos * HEIGHT_M, cos, 0.0, -sin, sin * HEIGHT_M)
    header = wire.PictureHeader(
        "head",
        number,
        "jpeg",
        WIDTH,
        HEIGHT,
        taken_ms,
        lens=(FOCAL_PX, FOCAL_PX, WIDTH / 2, HEIGHT / 2),
        pose=pose,
    )
    head = msgspec.json.encode(header)
    return len(head).to_bytes(4, "big") + head + picture()
