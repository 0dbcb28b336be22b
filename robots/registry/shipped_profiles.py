"""The profiles that come with the console, as data files under robots/registry/profiles/.

After each migration `robots.registry.services.profiles_load_shipped` loads new profiles and updates profiles that
nobody has edited. It keeps an edited profile; the admin shows that the shipped one differs and offers to load it.
A profile's phrases are in a text file next to it. They are loaded and updated separately, by the same rules.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import yaml
from msgspec import Struct

from robots.registry.models import RobotProfile
from robots.registry.phrases import Line, read_file
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.gate_profile import Limits
from robots.shared.configuration.input_filters import DEFAULT, StickStep
from robots.shared.configuration.robot_ros import RosVersion
from robots.shared.messages.type_names import in_ros2
from robots.shared.wire import ReverseSteering

DIRECTORY = Path(__file__).parent / "profiles"


class ProfileFile(Struct, frozen=True, forbid_unknown_fields=True):
    """One data file of a profile."""

    slug: str
    name: str
    holonomic: bool
    limits: Limits
    blind_mps: float
    default_share: float
    reverse_steering: ReverseSteering
    drive: Topic
    footprint: dict[str, Any]
    topics: dict[str, Any]
    gate: dict[str, float]
    stick: tuple[StickStep, ...] = DEFAULT
    phrases: str | None = None  # name of a file next to this one
    ros: RosVersion = 1

    def phrase_lines(self, directory: Path = DIRECTORY) -> list[Line]:
        """Return the profile's shipped phrases."""
        return read_file(directory / self.phrases) if self.phrases else []

    def columns(self) -> dict[str, Any]:
        """Return the values of the profile's columns, except the slug."""
        columns: dict[str, Any] = msgspec.to_builtins(self)
        del columns["slug"], columns["phrases"]
        limits, drive = columns.pop("limits"), columns.pop("drive")
        columns |= limits | {"drive_topic": drive["name"], "drive_type": drive["type"]}
        return columns | {"stick": list(columns["stick"])}


def profile_files(directory: Path = DIRECTORY) -> list[ProfileFile]:
    """Return every shipped profile, sorted by file name."""
    read = (yaml.safe_load(path.read_text(encoding="utf-8")) for path in sorted(directory.glob("*.yaml")))
    by_slug = {data["slug"]: data for data in read}
    return [msgspec.convert(_whole(data, by_slug), ProfileFile) for data in by_slug.values()]


def _whole(data: dict[str, Any], by_slug: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return a file's content with what it takes from the profile that it is `like`.

    Its own keys win, each key of `topics` too; null: it has no such topic. Types of messages get the names of its ROS.
    """
    if "like" not in data:
        return data
    other = by_slug[data["like"]]
    topics = {
        key: value for key, value in (other["topics"] | data.get("topics", {})).items() if value is not None
    }
    own = {key: value for key, value in data.items() if key != "like"}
    merged = other | own | {"topics": topics}
    return _typed(merged) if merged.get("ros") == 2 else merged


def _typed(value: Any) -> Any:
    """Return the value with ROS 2's names of all types of messages in it."""
    match value:
        case list():
            return [_typed(item) for item in value]
        case dict():
            return {key: in_ros2(item) if key == "type" else _typed(item) for key, item in value.items()}
    return value


def fill(profile: RobotProfile, file: ProfileFile) -> None:
    """Fill `profile` from `file`, without saving."""
    for name, value in file.columns().items():
        setattr(profile, name, value)
    profile.shipped = file.columns()


def file_of(profile: RobotProfile) -> ProfileFile | None:
    """Return the data file of a profile; None if it is not shipped."""
    return next((file for file in profile_files() if file.slug == profile.slug), None)


def is_edited(profile: RobotProfile) -> bool:
    """Return whether the profile was changed since it was last loaded from a file."""
    return not profile.shipped or profile.shipped != _now(profile, profile.shipped)


def differs(profile: RobotProfile, file: ProfileFile) -> bool:
    columns = file.columns()
    return _now(profile, columns) != columns


def _now(profile: RobotProfile, columns: Iterable[str]) -> dict[str, Any]:
    return {name: getattr(profile, name) for name in columns}
