"""Recording a robot by a program: begin, end, keep what was."""

from __future__ import annotations

from functools import partial
from typing import Annotated
from uuid import UUID

from msgspec import Meta, Struct

from fleet.accounts.tokens.models import Scope
from robots.access.selectors import supervises
from robots.link.connections import LinkRefused
from robots.link.state_reader import order_once
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.wire import KeepThis, LinkRecord, Record, RecordEnd, RecordingRequest
from robots.shared.wire.recordings import RecordedTopics
from teleop.api.v1.framework.operation import operation
from teleop.api.v1.setup.base import SetupView
from teleop.recordings.orders.requests import Asked, NamedRobot, ask_on_record, record_outcome

ANSWER_S = 12.0  # a recorder takes seconds to start
records = partial(operation, scope=Scope.TOPICS, refuses=(403, 404, 409, 503))

Reason = Annotated[str, Meta(max_length=200)]


class BeginRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """The recorded topics: "all", "pictures_not" (no images and clouds), or names of topics."""

    topics: RecordedTopics = "pictures_not"
    reason: Reason = ""


class Begun(Struct, frozen=True):
    """The recording; it is listed when it has ended."""

    recording: UUID
    seconds: float  # until it ends by itself


class KeepNowRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Why it is kept."""

    reason: Reason = ""


class RecorderView(SetupView):
    tag = "recordings"

    def carry_out(self, robot: Robot, request: RecordingRequest) -> Asked:
        """Check, record and send a request. Raises `NotDone`."""
        person = self.person
        asked = ask_on_record(request, NamedRobot(robot.id, robot.name), person, supervises(person, robot))
        try:
            order_once(robot.id, link_address(robot), asked.order, ANSWER_S)
        except LinkRefused as refused:
            record_outcome(asked.begun, person, refused.refusal)
            raise
        record_outcome(asked.begun, person, None)
        return asked


class RecordingsOfRobotView(RecorderView):
    @records("recording_begin", "Record a robot", status=201)
    def post(self, slug: str, body: BeginRequest) -> Begun:
        """Until the slot ends. For the person in control, supervisors of the robot and staff."""
        order = self.carry_out(self.robot(slug), Record(body.topics, body.reason)).order
        assert isinstance(order, LinkRecord)  # noqa: S101  # for the type
        return Begun(order.recording, order.seconds)


class RecordingOfRobotView(RecorderView):
    @records("recording_end", "End a recording of a robot")
    def delete(self, slug: str, recording_id: UUID) -> None:
        """Also for the person who began it."""
        self.carry_out(self.robot(slug), RecordEnd(recording_id))


class KeepNowView(RecorderView):
    @records("recording_keep_this", "Keep the last 30 s and the next 15 s")
    def post(self, slug: str, body: KeepNowRequest) -> None:
        """While somebody has control. For the person in control, supervisors of the robot and staff."""
        self.carry_out(self.robot(slug), KeepThis(body.reason))
