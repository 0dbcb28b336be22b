"""Gripper and torso by a program."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct
from rest_framework.response import Response

from robots.registry.selectors import robot_facts
from robots.shared import wire
from robots.shared.wire import Limb, Refusal
from robots.shared.wire.limbs import LimbPosition
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.robot.tasks import TasksBase, acts, starts


class GripperRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Either a distance of the fingers in metres, or one of their ends."""

    width_m: Annotated[float, Meta(ge=0.0, le=1.0)] | None = None
    to: Literal["open", "closed"] | None = None


class TorsoRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A height above the torso's lowest place, metres."""

    height_m: LimbPosition


class LimbView(TasksBase):
    kind = wire.LIMB
    limb: Limb

    def move(self, slug: str, to_m: float) -> Response:
        """Request a move of the limb. Return the answer 202 with the task's status and address."""
        return self.start(
            self.robot(slug),
            lambda fence, seq: wire.MoveLimb(fence, self.limb, to_m, seq),
            self.limb,
        )

    def cancel_move(self, slug: str) -> None:
        """End the limb's move."""
        self.cancel(slug, lambda fence, seq: wire.LimbCancel(fence, self.limb, seq), self.limb)


class GripperView(LimbView):
    limb = "gripper"

    @starts("gripper_move", "Open or close the gripper", wire.LIMB, examples={"Open": {"to": "open"}})
    def post(self, slug: str, body: GripperRequest) -> Response:
        """Needs control, and a base that stands. The answer’s header Location is the address of its status."""
        if (body.width_m is None) == (body.to is None):
            raise Problem(Refusal("invalid", "Give either width_m or to.", "wire"))
        if body.width_m is not None:
            return self.move(slug, body.width_m)
        ends = robot_facts(self.robot(slug)).limbs.get(self.limb)
        if ends is None:
            return self.move(slug, 0.0)  # the bridge refuses: there is no gripper
        return self.move(slug, ends.most_m if body.to == "open" else ends.least_m)

    @acts("gripper_cancel", "End the gripper’s move", wire.LIMB)
    def delete(self, slug: str) -> None:
        """The fingers stay where they are."""
        self.cancel_move(slug)


class TorsoView(LimbView):
    limb = "torso"

    @starts("torso_move", "Raise or lower the torso", wire.LIMB)
    def post(self, slug: str, body: TorsoRequest) -> Response:
        """Needs control, a base that stands, and the arm at home. Location is the address of its status."""
        return self.move(slug, body.height_m)

    @acts("torso_cancel", "End the torso’s move", wire.LIMB)
    def delete(self, slug: str) -> None:
        """The torso stays where it is."""
        self.cancel_move(slug)
