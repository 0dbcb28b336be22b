"""The robot's description and its meshes, from which a page or a program draws the robot."""

from __future__ import annotations

import hashlib
import zlib
from functools import lru_cache
from urllib.parse import quote

from django.conf import settings
from django.http import HttpResponse, HttpResponseBase
from drf_spectacular.utils import OpenApiParameter
from msgspec import UNSET, Struct, UnsetType
from rest_framework.response import Response

from robots.description.drawable import Drawable, drawable
from robots.description.meshes import Mesh, NoMesh, mesh_at
from robots.registry.models import Robot, RobotDescription
from robots.shared import wire
from robots.shared.sentences import of_parts, reason_of, say
from robots.shared.urdf.document import BadDescription
from robots.shared.wire import Refusal, Said, Worded
from teleop.api.v1.framework.operation import reads
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.framework.versions import unchanged
from teleop.api.v1.robot.control import ProgramView

NO_DESCRIPTION = Refusal(
    "not_found",
    "The console knows no description of this robot yet: its bridge reads /robot_description when the robot is there.",
    "robot",
)
NO_MESH = Refusal("not_found", "The robot’s description names no such mesh.", "robot")
_YEAR_S = 365 * 24 * 60 * 60
_VERSION = OpenApiParameter("version", str, description="As in the description.")


class MeshEntry(Worded, frozen=True):
    """A mesh of the description. `address` null: it cannot be had, and `problem` says why."""

    SENTENCES = ("problem",)

    filename: str  # as in the description
    address: str | None
    problem: str = ""


class DescriptionEntry(Struct, frozen=True):
    """The part of the robot's description that can be drawn: links with their shapes and colours, and joints.

    `problems` name what was left out of `urdf`.
    """

    digest: str  # of the robot's own text
    seen_at: Time
    urdf: str
    meshes: list[MeshEntry]
    problems: list[str]
    said: Said | UnsetType = UNSET  # keys and figures of `problems`, for a page in another language


class DescriptionView(ProgramView):
    tag = "robots"

    @reads("description_read", "Read the robot’s description", answer=DescriptionEntry, refuses=(404, 409))
    def get(self, slug: str) -> HttpResponseBase:
        """The newest one that its bridge has read from /robot_description, without collision, inertia and plug-ins.
        With its ETag in If-None-Match the answer is 304 while nothing has changed."""
        robot = self.robot(slug)
        kept = _kept(robot)
        found = _drawable(kept)
        entry = DescriptionEntry(
            digest=kept.digest,
            seen_at=kept.seen_at,
            urdf=found.urdf,
            meshes=[_entry(robot, filename) for filename in found.meshes],
            problems=[str(problem) for problem in found.problems],
            said={"problems": [problem.parts for problem in found.problems]} if found.problems else UNSET,
        )
        tag = f'"{hashlib.sha256(wire.encode(entry)).hexdigest()[:16]}"'
        response = unchanged(self.request, tag) or Response(wire.to_builtins(entry))
        response["Cache-Control"] = "private, no-cache"
        response["ETag"] = tag
        return response


class MeshView(ProgramView):
    tag = "robots"

    @reads(
        "mesh_read",
        "Read a mesh of the robot",
        content_type="application/octet-stream",
        refuses=(404, 409),
        parameters=[_VERSION],
    )
    def get(self, slug: str, package: str, path: str) -> HttpResponseBase:
        """STL, Collada or OBJ, one that the robot's description names. With its present version, as
        `GET …/description` gives it, it may be kept for good."""
        mesh = _named(_drawable(_kept(self.robot(slug))), package, path)
        tag = f'"{mesh.version}"'
        response = unchanged(self.request, tag) or HttpResponse(
            _read(mesh), content_type="application/octet-stream"
        )
        is_fixed = self.request.query_params.get(_VERSION.name) == mesh.version
        response["Cache-Control"] = (
            f"private, max-age={_YEAR_S}, immutable" if is_fixed else "private, no-cache"
        )
        response["ETag"] = tag
        return response


def _kept(robot: Robot) -> RobotDescription:
    """Return the robot's description. Raises `Problem`: there is none that can be used."""
    kept = RobotDescription.objects.filter(robot=robot).first()
    if kept is None:
        raise Problem(NO_DESCRIPTION)
    if kept.problem:
        raise _bad(of_parts(kept.problem, [kept.problem]))
    return kept


def _drawable(kept: RobotDescription) -> Drawable:
    try:
        return _reduced(bytes(kept.packed))
    except BadDescription as bad:
        raise _bad(reason_of(bad)) from bad


@lru_cache(maxsize=16)
def _reduced(packed: bytes) -> Drawable:
    return drawable(zlib.decompress(packed).decode())


def _bad(why: str) -> Problem:
    return Problem(Refusal("bad_description", say("The robot cannot be drawn: {why}.", why=why), "robot"))


def _entry(robot: Robot, filename: str) -> MeshEntry:
    try:
        mesh = mesh_at(filename, settings.FLEET_MESHES)
    except NoMesh as no_mesh:
        return MeshEntry(filename, None, say("{why}.", why=no_mesh))
    path = quote(f"{mesh.package}/{mesh.path}")
    return MeshEntry(filename, f"/api/v1/robots/{robot.slug}/meshes/{path}?version={mesh.version}")


def _named(found: Drawable, package: str, path: str) -> Mesh:
    """Return the mesh of the description with this package and path. Raises `Problem`."""
    for filename in found.meshes:
        if not filename.endswith(path):
            continue
        try:
            mesh = mesh_at(filename, settings.FLEET_MESHES)
        except NoMesh:
            continue
        if (mesh.package, mesh.path) == (package, path):
            return mesh
    raise Problem(NO_MESH)


def _read(mesh: Mesh) -> bytes:
    try:
        return mesh.file.read_bytes()
    except OSError as error:
        raise Problem(
            Refusal(
                "not_found",
                say("The mesh {path} cannot be read: {why}.", path=mesh.path, why=error.strerror),
                "robot",
            )
        ) from error
