"""Orders to recorders by the console itself, and what the log knows of the recording that goes on."""

from __future__ import annotations

from uuid import UUID

from django.db.models import Q

from fleet.audit.models import Record
from fleet.audit.services import record
from robots.link.state_reader import order_once, state_once
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.wire import LinkRecord, LinkRecordEnd, NotDone, RecordingState
from teleop.recordings.orders.quota import check_quota

ANSWER_S = 10.0  # a recorder takes seconds to start


def going_on(robot: Robot) -> RecordingState | None:
    """Return the recording of a robot that goes on, also if its disk is slow now. Raises `NotDone`."""
    state = state_once(robot.pk, link_address(robot)).recording
    has_ended = state is not None and state.refusal is not None and state.left_s <= 0
    return None if has_ended else state


def carry_out(robot: Robot, order: LinkRecord | LinkRecordEnd, **why: str) -> None:
    """Record an order of the console, send it, and record its outcome. Raises `NotDone`."""
    parameters = {"recording": str(order.recording), **why}
    if isinstance(order, LinkRecord):
        begun = record("recording.begin", robot_id=robot.pk, robot_name=robot.name, parameters=parameters)
    else:
        begun = record("recording.end", robot_id=robot.pk, robot_name=robot.name, parameters=parameters)
    try:
        if isinstance(order, LinkRecord):
            check_quota(robot.pk, None)
        order_once(robot.pk, link_address(robot), order, ANSWER_S)
    except NotDone as refused:
        outcome, words = refused.refusal.code, {"words": refused.refusal.sentence}
        record(begun.kind, of=begun, outcome=outcome, private=words)
        raise
    record(begun.kind, of=begun, outcome="accepted")


def last_accepted(kind: str, robot_id: UUID, **of: str) -> Record | None:
    """Return the newest request of a kind on a robot that its bridge accepted; None: there is none.

    The recording that goes on is that of the last begin, also if it has another number since its recorder broke.
    `of`: parameters of the request.
    """
    asked = Q(**{f"of__parameters__{name}": value for name, value in of.items()})
    answers = Record.objects.filter(asked, robot_id=robot_id, kind=kind, outcome="accepted")
    answer = answers.select_related("of").order_by("-pk").first()
    return answer.of if answer is not None else None
