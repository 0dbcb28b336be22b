"""ROS classes by type name, also of types that the distribution does not package.

`definitions/` has one file for each of PAL's types. genpy generates Python from them once per change, in a
folder named by a digest of its inputs, so that processes never see an incomplete or old folder. The first use of
a generated class adds the folder to the last that Python searches; from then on ``import play_motion_msgs.msg`` works.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import genpy

from robots.shared.ros import last_finder
from robots.shared.texts import NAME, cut

DEFINITIONS = Path(__file__).with_name("definitions")
REPOSITORY = Path(__file__).resolve().parents[4]


class UnknownTypeError(LookupError):
    """The type is neither installed nor among our definitions."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no ROS type {name!r}: neither installed nor among our definitions")


def message_class(name: str) -> type[Any]:
    """Return the class of message type `name`, such as ``play_motion_msgs/PlayMotionActionGoal``."""
    return _class(name, "msg")


def service_class(name: str) -> type[Any]:
    """Return the class of service type `name`, such as ``play_motion_msgs/ListMotions``."""
    return _class(name, "srv")


@cache
def _class(name: str, kind: str) -> type[Any]:
    package, _, short = name.partition("/")
    if len(name) > NAME:
        raise UnknownTypeError(cut(name, NAME))
    if not (package.isidentifier() and short.isidentifier()):
        raise UnknownTypeError(name)
    if (DEFINITIONS / package).is_dir():
        make_ours_importable()
    try:
        found: type[Any] = getattr(import_module(f"{package}.{kind}"), short)
    except (ModuleNotFoundError, AttributeError) as error:
        raise UnknownTypeError(name) from error
    return found


@cache
def make_ours_importable() -> Path:
    """Generate our packages unless that was done before, and let Python find them where ROS has none of the name."""
    folder = _generated()
    last_finder.folders.append(str(folder))
    return folder


def definition_files() -> list[Path]:
    return sorted(file for file in DEFINITIONS.rglob("*.*") if file.suffix in {".msg", ".srv", ".action"})


def _digest() -> str:
    """Return a digest of all inputs of the generated code."""
    generators = (Path(__file__).with_name("generate.py"), Path(genpy.__file__).with_name("generator.py"))
    digest = hashlib.sha256()
    for file in (*definition_files(), *generators):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def _generated() -> Path:
    cache_folder = _cache_folder()
    target = cache_folder / _digest()
    if target.is_dir():
        return target

    from robots.shared.ros.message_types.generate import generate

    # Generated in a temporary folder and moved in one step: two processes may do this at once.
    draft = Path(tempfile.mkdtemp(dir=cache_folder, prefix="draft-"))
    generate(definition_files(), draft)
    try:
        draft.rename(target)
    except OSError:
        if not target.is_dir():
            raise
        shutil.rmtree(draft)  # another process was faster, with the same content
    return target


def _cache_folder() -> Path:
    """Return the folder of generated classes. Only our user may write there, since we run its code."""
    wanted = Path(os.environ.get("FLEET_VAR") or REPOSITORY / "var") / "ros-types"
    try:
        wanted.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return _short_lived_folder()
    return wanted if os.access(wanted, os.W_OK) else _short_lived_folder()


@cache
def _short_lived_folder() -> Path:
    """Return a folder for a read-only installation: each process generates and removes its own classes."""
    folder = Path(tempfile.mkdtemp(prefix="fleet-ros-types-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
