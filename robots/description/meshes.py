"""Finds the meshes of a robot's description: files of ROS packages on this computer, and nothing else."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

from robots.shared.sentences import say

LARGEST_MESH = 25_000_000  # bytes
DEEPEST = 10  # folders from a package to a mesh with a file:// address
FORMATS = (".stl", ".dae", ".obj")
_PACKAGE = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,99}")
_PACKAGE_ADDRESS, _FILE_ADDRESS = "package://", "file://"


class NoMesh(Exception):
    """There is no mesh at this address; the text says why."""


class Mesh(NamedTuple):
    """A mesh that can be read. People and pages use `package` and `path` as its name."""

    package: str
    path: str
    file: Path
    version: str  # changes when the file changes


def mesh_at(address: str, folders: Sequence[Path]) -> Mesh:
    """Return the mesh with this address in a description (`package://…`, or `file://…` in a known package).

    Each of `folders` is a ROS package, or contains packages one or two levels down. Raises `NoMesh`.
    """
    package, path = _split(address, folders)
    parts = path.split("/")
    if not _PACKAGE.fullmatch(package):
        raise NoMesh(say("“{mesh}” names no package", mesh=_short(address)))
    if any(part in ("", ".", "..") for part in parts) or "\\" in path or not path.isprintable():
        raise NoMesh(say("“{mesh}” leads out of its package", mesh=_short(address)))
    if Path(path).suffix.lower() not in FORMATS:
        raise NoMesh(
            say("“{mesh}” is neither STL nor Collada nor OBJ, which pages draw", mesh=_short(address))
        )
    try:
        for folder in _packages(package, folders):
            file = (folder / path).resolve()
            if not file.is_relative_to(folder.resolve()):
                raise NoMesh(say("“{mesh}” leads out of its package", mesh=_short(address)))
            if file.is_file():
                return _mesh(package, path, file, address)
    except (OSError, RuntimeError) as error:  # name too long, no permission, symbolic links in a circle
        raise NoMesh(say("“{mesh}” cannot be read", mesh=_short(address))) from error
    raise NoMesh(say("“{mesh}” is not on the console’s computer", mesh=_short(address)))


def _mesh(package: str, path: str, file: Path, address: str) -> Mesh:
    try:
        status = file.stat()
    except OSError as error:
        raise NoMesh(
            say("“{mesh}” cannot be read: {why}", mesh=_short(address), why=error.strerror)
        ) from error
    if status.st_size > LARGEST_MESH:
        sizes = {"size": status.st_size / 1e6, "most": LARGEST_MESH / 1e6}
        raise NoMesh(
            say("“{mesh}” has {size:.0f} MB; at most {most:.0f} are drawn", mesh=_short(address), **sizes)
        )
    facts = f"{file} {status.st_size} {status.st_mtime_ns}"
    return Mesh(package, path, file, hashlib.sha256(facts.encode()).hexdigest()[:16])


def _split(address: str, folders: Sequence[Path]) -> tuple[str, str]:
    """Return the package, and the path inside the package."""
    if address.startswith(_PACKAGE_ADDRESS):
        package, _, path = address.removeprefix(_PACKAGE_ADDRESS).partition("/")
        return package, path
    if address.startswith(_FILE_ADDRESS):
        # The address is a path on the robot's computer: use the package with the same name on this computer.
        file = address.removeprefix(_FILE_ADDRESS)
        if ".." not in file.split("/"):
            for folder in islice(Path(file).parents, DEEPEST):
                if _is_package(folder.name, folders):
                    return folder.name, Path(file).relative_to(folder).as_posix()
        raise NoMesh(say("“{mesh}” lies in no package on the console’s computer", mesh=_short(address)))
    raise NoMesh(say("“{mesh}” is no address of a package", mesh=_short(address)))


def _packages(name: str, folders: Sequence[Path]) -> Iterator[Path]:
    """Yield the folders of packages with this name."""
    if not _PACKAGE.fullmatch(name):
        return
    for folder in folders:
        own = [folder] if folder.name == name else []
        for candidate in chain([*own, folder / name], folder.glob(f"*/{name}")):
            if (candidate / "package.xml").is_file():
                yield candidate


def _is_package(name: str, folders: Sequence[Path]) -> bool:
    try:
        return next(_packages(name, folders), None) is not None
    except OSError:
        return False


def _short(address: str) -> str:
    return address if len(address) <= 200 else address[:199] + "…"
