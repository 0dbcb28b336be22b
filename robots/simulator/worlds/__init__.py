"""Worlds are data: `load_world("office")` reads ``office.yaml`` in this folder, or any path."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta, Struct

Point = tuple[float, float]
Positive = Annotated[float, Meta(gt=0.0)]
Colour = Annotated[str, Meta(pattern="^#[0-9a-f]{6}$")]  # red, green, blue


class Wall(Struct, frozen=True, rename={"start": "from", "end": "to"}, forbid_unknown_fields=True):
    """Upright slab along the line between two points, half its thickness to either side."""

    name: str
    start: Point
    end: Point
    height: Positive = 2.4
    thickness: Positive = 0.1
    colour: Colour = "#d9d9d1"


class Table(Struct, frozen=True, forbid_unknown_fields=True):
    """A top on four legs, or without legs (hung on a wall)."""

    name: str
    at: Point
    size: tuple[Positive, Positive]
    yaw: float = 0.0
    height: Positive = 0.74
    top_m: Positive = 0.03
    leg_m: Positive = 0.04
    legs: bool = True


class Chair(Struct, frozen=True, forbid_unknown_fields=True):
    """Seat, back and four thin legs; faces along its yaw."""

    name: str
    at: Point
    yaw: float = 0.0
    seat: Positive = 0.42
    height: Positive = 0.45
    colour: Colour = "#40598c"


class Box(Struct, frozen=True, forbid_unknown_fields=True):
    """A box that stands on the floor, or floats `z` above it."""

    name: str
    at: Point
    size: tuple[Positive, Positive, Positive]
    yaw: float = 0.0
    z: float = 0.0
    colour: Colour = "#9e754d"


class Person(Struct, frozen=True, forbid_unknown_fields=True):
    """A person who stands at `at`, or walks back and forth along `path`."""

    name: str
    at: Point
    path: list[Point] = []
    speed_mps: Positive = 0.8
    walks: bool = False
    radius: Positive = 0.2
    height: Positive = 1.75


class Place(Struct, frozen=True, forbid_unknown_fields=True):
    """A named place to which robots can be sent, with their heading in degrees."""

    name: str
    at: Point
    heading: float = 0.0


class World(Struct, frozen=True, forbid_unknown_fields=True):
    """All objects around the robot. Metres and degrees."""

    name: str
    size: tuple[float, float, float, float]
    walls: list[Wall] = []
    tables: list[Table] = []
    chairs: list[Chair] = []
    boxes: list[Box] = []
    decoration: list[Box] = []  # seen by colour cameras only
    people: list[Person] = []
    starts: list[tuple[float, float, float]] = []
    places: list[Place] = []


def load_world(name: str) -> World:
    """Read a world by name or path; raises `ValueError` with the file's name and the reason."""
    path = Path(name) if name.endswith(".yaml") else Path(__file__).with_name(f"{name}.yaml")
    try:
        return msgspec.yaml.decode(path.read_bytes(), type=World)
    except FileNotFoundError as error:
        raise ValueError(f"there is no world {name!r} ({path})") from error
    except msgspec.DecodeError as error:
        raise ValueError(f"{path}: {error}") from error
