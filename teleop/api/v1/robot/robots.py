"""Robots: the list, one with its state, its phrases, the history of its speech."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Annotated

from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter
from msgspec import Meta, Struct

from robots.access.selectors import roles_by_id
from robots.link import stop_courier as courier
from robots.link.connections import LinkRefused
from robots.link.state_reader import state_once
from robots.registry.models import Robot, Role
from robots.registry.selectors import link_address, phrases_of, robot_rows
from robots.shared.link.pending_stops import name_of
from robots.shared.wire import PendingStop, Refusal, RobotFacts, State
from teleop.api.v1.framework.operation import ApiView, entry_of, reads
from teleop.api.v1.framework.parameters import Time, whole_number
from teleop.control import lease_checks
from teleop.control.rules import out_of_service
from teleop.control.selectors import lease_of
from teleop.reports.history import SpeechHistory, speech_history

LONGEST_PAGE = 200  # entries of history at once
HIGHEST_NUMBER = 2**63 - 1


class RobotEntry(Struct, frozen=True):
    """A robot in a list, with your role on it."""

    slug: str
    name: str
    profile: str
    practice: bool  # a simulated one
    enabled: bool
    role: str | None


class RobotList(Struct, frozen=True):
    """Robots, by name."""

    robots: list[RobotEntry]


class RobotDetail(RobotEntry, frozen=True):
    """A robot and its state, as far as its bridge knows it; `refusal` says why the state is unknown."""

    facts: RobotFacts
    holder: str | None  # of control
    state: State | None
    seen_at: Time | None  # when the robot's last message came
    refusal: Refusal | None
    pending_stop: PendingStop | None


class PhraseEntry(Struct, frozen=True):
    """A sentence that staff wrote for a robot."""

    id: int
    text: str
    language: str
    tags: list[str]


class PhraseList(Struct, frozen=True):
    """Phrases, in their order."""

    phrases: list[PhraseEntry]


class RobotsAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """Filters of robots."""

    profile: Annotated[str, Meta(max_length=100, description="A kind of robot.")] | None = None
    group: Annotated[str, Meta(max_length=100, description="A robot group.")] | None = None
    enabled: bool | None = None


class RobotsView(ApiView):
    @reads("robots_list", "List the robots that you may see", refuses=())
    def get(self, query: RobotsAsked) -> RobotList:
        """The state of a robot is at its own address."""
        served = [row for row in robot_rows() if self.token_serves(row.id)]
        if query.profile is not None:
            served = [row for row in served if row.profile == query.profile]
        if query.enabled is not None:
            served = [row for row in served if row.enabled == query.enabled]
        if query.group is not None:
            members = set(Robot.objects.filter(groups__slug=query.group).values_list("pk", flat=True))
            served = [row for row in served if row.id in members]
        roles = roles_by_id(self.person, [row.id for row in served])
        return RobotList(
            [entry_of(RobotEntry, row, role=roles[row.id].value) for row in served if row.id in roles]
        )


class RobotView(ApiView):
    @reads("robots_read", "Read one robot and its state")
    def get(self, slug: str) -> RobotDetail:
        """State, sensors and their ages, battery, stop, gate's verdict, limits."""
        known, role = self.known_robot(slug)
        robot = known.robot
        lease = lease_of(robot.id)
        held = lease is not None and lease_checks.lapse_reason(lease, timezone.now()) is None
        state, refusal = _state(robot)
        return entry_of(
            RobotDetail,
            robot,
            profile=robot.profile.slug,
            role=role.value,
            facts=known.facts,
            holder=lease.name if lease and held else None,
            state=state,
            seen_at=_seen_at(state),
            refusal=refusal,
            pending_stop=_pending(robot),
        )


class PhrasesView(ApiView):
    @reads("phrases_list", "List a robot’s phrases")
    def get(self, slug: str) -> PhraseList:
        """Sentences that staff wrote for this robot."""
        known, _ = self.known_robot(slug)
        lines = phrases_of(known.robot)
        return PhraseList([PhraseEntry(key, one.text, one.language, list(one.tags)) for key, one in lines])


class SpeechHistoryView(ApiView):
    @reads(
        "speech_history",
        "Read what a robot said",
        refuses=(400, 404),
        parameters=[
            OpenApiParameter("before", int, description="Entries with a number below this one."),
            OpenApiParameter(
                "limit", int, description=f"The most entries to return, 1 to {LONGEST_PAGE}; 50 if left out."
            ),
        ],
    )
    def get(self, slug: str) -> SpeechHistory:
        """Newest first, from the audit log. Only supervisors of the robot and staff get entries of other people."""
        known, role = self.known_robot(slug)
        return speech_history(
            known.robot.id,
            None if role >= Role.SUPERVISOR else self.person.id,
            before=whole_number(self.request, "before", HIGHEST_NUMBER, HIGHEST_NUMBER),
            limit=whole_number(self.request, "limit", 50, LONGEST_PAGE),
        )


def _seen_at(state: State | None) -> datetime | None:
    """Return when the robot's last message came, as its bridge reports it; None: unknown."""
    if state is None or state.unseen_s is None:
        return None
    return timezone.now() - timedelta(seconds=state.unseen_s)


def _pending(robot: Robot) -> PendingStop | None:
    """Return the newest pending stop."""
    waiting = courier.pending_stops().of(name_of(robot.id))
    return waiting[-1].on_wire() if waiting else None


def _state(robot: Robot) -> tuple[State | None, Refusal | None]:
    try:
        return state_once(robot.id, link_address(robot)), None
    except LinkRefused as refused:
        return None, out_of_service(robot) or refused.refusal
