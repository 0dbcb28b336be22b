"""A robot's cameras: the list, and one picture of a camera."""

from __future__ import annotations

import threading
from typing import Annotated

from asgiref.sync import async_to_sync
from django.http import HttpResponse
from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from robots.shared.sentences import say
from robots.shared.wire import CameraEntry, CameraSize, CameraWatch, Refusal
from teleop.api.v1.framework.operation import operation, reads
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.framework.rates import place_in
from teleop.api.v1.programs.camera_pictures import one_picture
from teleop.api.v1.programs.registry import programs
from teleop.api.v1.robot.control import ProgramView

MOST_WAITING = 4  # each occupies a thread, and pages need threads, too

_waiting = threading.BoundedSemaphore(MOST_WAITING)
_BUSY = Refusal("busy", "Too many programs wait for pictures: try again in a moment.", "robot")


class CameraList(Struct, frozen=True):
    """The cameras of a robot; `moves`: it is on a head that can be turned."""

    cameras: list[CameraEntry]


class PictureAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """How large the picture is."""

    size: Annotated[CameraSize, Meta(description="As the camera has it, or at most 320 pixels wide.")] = (
        "full"
    )


class CamerasView(ProgramView):
    tag = "robots"

    @reads("cameras_list", "List a robot’s cameras")
    def get(self, slug: str) -> CameraList:
        """As they are registered."""
        return CameraList(self.known_robot(slug)[0].facts.cameras)


class CameraPictureView(ProgramView):
    tag = "robots"

    @operation(
        "cameras_picture",
        "Read one picture of a camera",
        scope=Scope.TOPICS,
        content_type="image/jpeg image/png",
        refuses=(404, 409),
    )
    def get(self, slug: str, camera: str, query: PictureAsked) -> HttpResponse:
        """The next one, within 12 s. PNG: of a depth or heat camera. The viewing is recorded, as on pages. For a stream
        use the WebSocket of cameras."""
        known, _ = self.known_robot(slug)
        if camera not in [one.name for one in known.facts.cameras]:
            text = say("This robot has no camera “{camera}”.", camera=camera[:40])
            raise Problem(Refusal("no_camera", text, "robot"), 404)
        watch = CameraWatch(camera, size=query.size)
        with place_in(_waiting, _BUSY):
            header, picture = async_to_sync(one_picture)(
                programs.path(), known.robot.slug, self.program_sign_in(), watch
            )
        answer = HttpResponse(picture, content_type=f"image/{header.format}")
        answer["Cache-Control"] = "no-store"
        return answer
