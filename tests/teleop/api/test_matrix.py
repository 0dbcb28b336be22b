"""All permissions of the API: role x scope x operation x (own, of the person's course, another's).

Each operation of the schema has one row: its scopes (a token needs one of them), its request, and its result
for each person in three places. In every place, a request without sign-in gets 401, one without the scope 403.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache
from itertools import cycle
from typing import Any
from uuid import uuid4

import pytest
from allauth.account.internal.flows.login import AUTHENTICATION_METHODS_SESSION_KEY
from django.db import transaction
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.services import service_account_make
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.audit.services import record
from fleet.bookings.models import Booking, Change, HandOffer, Holiday, OutOfService, State, Waiting
from robots.access.enrolment import invitation_make
from robots.access.models import Course, Enrolment, Qualification, RobotGroup
from robots.access.selectors import lab_date, role_on
from robots.access.services import qualification_grant, role_set
from robots.places.entries import PlaceEntry
from robots.places.services import place_add
from robots.recordings.models import Recording
from robots.registry.models import Robot, RobotProfile, Role
from robots.shared.wire import TASK_KINDS, StopState
from script.generate.messages import OPENAPI
from teleop.control.allowed.scopes import ACTING
from teleop.models import ControlSession, RecordingShare, SharedLayout
from teleop.records import refusals
from teleop.stop import emergency_stop
from teleop.webhooks.services import webhook_make
from tests.robots.places.maps import map_of
from tests.teleop.api.conftest import Caller
from tests.teleop.api.test_bookings import hour, words

# --- people and places ----------------------------------------------------------------------------

PLACES = ("own", "course", "other")
PEOPLE = ("observer", "operator", "teacher", "supervisor", "staff")
# The robot "own": the person has a role on it; "course": the robot of the teacher's course, in which the
# operator is; "other": neither.
ROLES: dict[str, dict[str, Role]] = {
    "observer": {"own": Role.OBSERVER, "course": Role.OBSERVER},
    "operator": {"own": Role.OPERATOR, "course": Role.OPERATOR},
    "teacher": {"course": Role.SUPERVISOR},
    "supervisor": {"own": Role.SUPERVISOR},
    "staff": dict.fromkeys(PLACES, Role.STAFF),
}

# --- results of operations --------------------------------------------------------------------------

# For each place, the results for observer, operator, teacher, supervisor, staff.
Ends = tuple[str, str, str]


def seen(done: str) -> Ends:
    """People who may see the robot get this result; the others get "not found"."""
    return (
        f"{done} {done} not_found {done} {done}",
        f"{done} {done} {done} not_found {done}",
        f"not_found not_found not_found not_found {done}",
    )


def everywhere(*ends: str) -> Ends:
    """Every place has the same results: one for all people, or one for each person."""
    line = " ".join(ends * 5 if len(ends) == 1 else ends)
    return (line, line, line)


def staff_only(done: str) -> Ends:
    """Staff everywhere, nobody else anywhere."""
    return everywhere(*["permission_denied"] * 4, done)


def robot_managed(done: str) -> Ends:
    """A supervisor of the robot itself, or staff; no supervisor of a course: other courses share the robot."""
    return (
        f"permission_denied permission_denied not_found {done} {done}",
        f"permission_denied permission_denied permission_denied not_found {done}",
        f"not_found not_found not_found not_found {done}",
    )


def recorded(done: str) -> Ends:
    """The owner, a supervisor of the robot, also by a course, or staff."""
    return (
        everywhere(done)[0],
        f"not_found not_found {done} not_found {done}",
        f"not_found not_found not_found not_found {done}",
    )


def supervised(done: str) -> Ends:
    """A supervisor of the robot, also by a course, or staff."""
    return (
        f"permission_denied permission_denied not_found {done} {done}",
        f"permission_denied permission_denied {done} not_found {done}",
        f"not_found not_found not_found not_found {done}",
    )


MANAGED_COURSE = (
    "not_found not_found {0} not_found {0}",
    "not_found not_found {0} not_found {0}",
    "not_found not_found not_found not_found {0}",
)


def managed(done: str) -> Ends:
    """The teacher manages their own course, staff every course."""
    return tuple(line.format(done) for line in MANAGED_COURSE)  # type: ignore[return-value]


# A person changes their own series; the teacher those of the course.
SERIES = (
    "200 200 not_found 200 200",
    "not_found not_found 200 not_found 200",
    "not_found not_found not_found not_found 200",
)
# People can read their own records, also of a robot that they may no longer see.
OWN_STAY = (everywhere("200")[0], *seen("200")[1:])


# The line of a team: of one's own; of a student, whom the teacher leads; of a stranger.
LED = (
    "200 200 not_found 200 200",
    "not_in_lesson not_in_lesson 200 not_found 200",
    "not_found not_found not_found not_found 200",
)
TAUGHT = tuple(line.replace("not_in_lesson", "not_teacher") for line in LED)


@dataclass(frozen=True)
class Row:
    """An operation: scopes, request, results. The object of person and place replaces `{...}` in the path."""

    scopes: tuple[Scope, ...]
    path: str
    ends: Ends
    body: Any = None
    version: bool = False  # it needs If-Match; the test sends the version of a new booking
    also: tuple[Scope, ...] = ()  # scopes that the token of a person with the right also needs


READ, DRIVE, _SPEAK, MOTIONS, TOPICS, BOOK, MANAGE = ((scope,) for scope in Scope)
# The web process decides about control and all that needs control, but does not run here: the API only checks
# that the person may see the robot. `tests/script/programs/test_programs.py` has the rest.
NO_LEASE, NO_PROGRAMS = seen("no_lease"), seen("no_programs")
RECORDER: Ends = tuple(  # type: ignore[assignment]
    line.replace("permission_denied", "no_lease") for line in supervised("bridge_down")
)
DAY = {"starts_at": words(hour(24)), "ends_at": words(hour(25))}
SLOT = {"starts_at": words(hour(48)), "ends_at": words(hour(49))}
TERM = {"starts_on": f"{lab_date()}", "ends_on": f"{lab_date() + timedelta(days=30)}"}
RULES = {
    **dict.fromkeys(("shortest_min", "longest_min", "notice_min", "cancel_notice_min", "gap_min"), 30),
    **dict.fromkeys(("day_min", "week_min", "at_once")),
    **{"opening": {}, "horizon_days": 30, "robots_at_once": 1, "grace_min": 10},
    **{"needs_approval": False, "free_time": True},
}
TOKEN = {"name": "new", "scopes": ["manage"]}

TABLE: dict[str, Row] = {
    # robots
    "index": Row((), "/", everywhere("200")),
    "robots_list": Row(READ, "/robots", everywhere("200")),
    "robots_read": Row(READ, "/robots/{robot}", seen("200")),
    "phrases_list": Row(READ, "/robots/{robot}/phrases", seen("200")),
    "speech_history": Row(READ, "/robots/{robot}/speech/history", seen("200")),
    "events": Row(READ, "/events?robot={robot}", seen("200")),
    # shared layouts of the page
    "layouts_list": Row(READ, "/robots/{robot}/layouts", seen("200")),
    "layouts_share": Row(
        MANAGE, "/robots/{robot}/layouts", supervised("201"), {"name": "new", "cells": ["map", "camera"]}
    ),
    "layouts_delete": Row(MANAGE, "/robots/{robot}/layouts/{layout}", supervised("204")),
    # doors of programs
    "tickets_make": Row(ACTING, "/robots/{robot}/tickets", seen("201"), {"door": "rosbridge"}),
    # control
    "control_read": Row(READ, "/robots/{robot}/control", seen("200")),
    "control_take": Row(ACTING, "/robots/{robot}/control", NO_PROGRAMS, {}),
    "control_release": Row(ACTING, "/robots/{robot}/control", NO_LEASE),
    "control_renew": Row(ACTING, "/robots/{robot}/control/renew", NO_LEASE),
    "control_ask": Row(ACTING, "/robots/{robot}/control/line", NO_PROGRAMS),
    "control_leave": Row(ACTING, "/robots/{robot}/control/line", NO_PROGRAMS),
    "control_hand_over": Row(ACTING, "/robots/{robot}/control/hand-over", NO_LEASE, {"number": 1}),
    "velocity": Row(DRIVE, "/robots/{robot}/velocity", NO_LEASE, {"forward_mps": 0.1}),
    "go": Row(DRIVE, "/robots/{robot}/go", NO_LEASE, {"x": 1.0, "y": 2.0}),
    "pose_set": Row(DRIVE, "/robots/{robot}/pose", NO_LEASE, {"x": 1.0, "y": 2.0}),
    "cameras_list": Row(READ, "/robots/{robot}/cameras", seen("200")),
    "cameras_picture": Row(TOPICS, "/robots/{robot}/cameras/none/picture", seen("no_camera")),
    "description_read": Row(READ, "/robots/{robot}/description", seen("not_found")),
    "mesh_read": Row(READ, "/robots/{robot}/meshes/tiago/base.stl", seen("not_found")),
    "map_read": Row(READ, "/robots/{robot}/map", seen("200")),
    "map_picture": Row(READ, "/robots/{robot}/map/picture", seen("200")),
    # maps and places
    "maps_list": Row(READ, "/maps?robot={robot}", seen("200")),
    "maps_read": Row(READ, "/maps/{map}", seen("200")),
    "maps_picture": Row(READ, "/maps/{map}/picture", seen("200")),
    "maps_name": Row(MANAGE, "/maps/{map}", supervised("changed"), {"name": "Hall"}, version=True),
    "places_list": Row(READ, "/maps/{map}/places", seen("200")),
    "places_add": Row(MANAGE, "/maps/{map}/places", supervised("201"), {"name": "hall", "x": 1.0, "y": 1.0}),
    "places_read": Row(READ, "/maps/{map}/places/{place}", seen("200")),
    "places_change": Row(
        MANAGE, "/maps/{map}/places/{place}", supervised("changed"), {"name": "hall"}, version=True
    ),
    "places_delete": Row(MANAGE, "/maps/{map}/places/{place}", supervised("204")),
    "places_export": Row(READ, "/maps/{map}/places/export", seen("200")),
    "places_import": Row(
        MANAGE, "/maps/{map}/places/import", supervised("200"), {"csv": "name,x,y,heading\nhall,1,1,0\n"}
    ),
    "gripper_move": Row(DRIVE, "/robots/{robot}/gripper", NO_LEASE, {"width_m": 0.05}),
    "gripper_cancel": Row(DRIVE, "/robots/{robot}/gripper", NO_LEASE),
    "torso_move": Row(DRIVE, "/robots/{robot}/torso", NO_LEASE, {"height_m": 0.1}),
    "torso_cancel": Row(DRIVE, "/robots/{robot}/torso", NO_LEASE),
    "stop_clear": Row(DRIVE, "/robots/{robot}/stop/clear", NO_PROGRAMS, {"number": 1}),
    "stop": Row((), "/robots/{robot}/stop", seen("200")),
    "stop_all": Row((), "/stop", everywhere("200")),
    # tasks
    "motions_list": Row(READ, "/robots/{robot}/motions", NO_PROGRAMS),
    "motions_play": Row(MOTIONS, "/robots/{robot}/motions/wave", NO_LEASE),
    "motions_cancel": Row(MOTIONS, "/robots/{robot}/motion", NO_LEASE),
    "tasks_read": Row(
        READ,
        "/robots/{robot}/tasks/{task}",
        (
            "200 200 not_found 200 200",  # one's own
            "not_found not_found 200 not_found 200",  # a student's
            "not_found not_found not_found not_found 200",
        ),
    ),
    # topics
    "topics_list": Row(TOPICS, "/robots/{robot}/topics", NO_PROGRAMS),
    "topics_definition": Row(TOPICS, "/robots/{robot}/topics/definition?type=a/B", NO_PROGRAMS),
    "topics_message": Row(TOPICS, "/robots/{robot}/topics/message?topic=/a", NO_PROGRAMS),
    "topics_publish": Row(TOPICS, "/robots/{robot}/topics/publish", NO_LEASE, {"topic": "/a", "type": "a/B"}),
    "topics_publish_end": Row(TOPICS, "/robots/{robot}/topics/publish?topic=/a", NO_LEASE),
    "services_definition": Row(TOPICS, "/robots/{robot}/services/definition?service=/a", NO_PROGRAMS),
    "services_call": Row(TOPICS, "/robots/{robot}/services/call", NO_PROGRAMS, {"service": "/a"}),
    "parameters_list": Row(TOPICS, "/robots/{robot}/parameters", NO_PROGRAMS),
    "parameters_read": Row(TOPICS, "/robots/{robot}/parameters/value?name=/a", NO_PROGRAMS),
    "parameters_set": Row(
        TOPICS, "/robots/{robot}/parameters/value", NO_PROGRAMS, {"name": "/a", "value": 1}
    ),
    "inputs_choose": Row(TOPICS, "/robots/{robot}/inputs/speech", NO_LEASE, {}),
    # bookings: one's own, a student's for the course, a stranger's on another robot
    "bookings_list": Row(READ, "/bookings?robot={robot}", seen("200")),
    "bookings_report": Row(
        READ, "/bookings/report", everywhere("permission_denied", "permission_denied", "200", "200", "200")
    ),
    "bookings_free": Row(READ, "/bookings/free?robot={robot}", seen("200")),
    "bookings_read": Row(READ, "/bookings/{booking}", seen("200")),
    "bookings_make": Row(
        BOOK,
        "/bookings",
        (
            "role_too_low 201 not_found 201 201",
            "role_too_low 201 201 not_found 201",
            "not_found not_found not_found not_found 201",
        ),
        {"robot": "{robot}", **SLOT},
    ),
    "bookings_move": Row(
        BOOK,
        "/bookings/{booking}",
        (
            "role_too_low 200 not_found 200 200",
            "not_yours not_yours 200 not_found 200",
            "not_found not_found not_found not_found 200",
        ),
        SLOT,
        version=True,
    ),
    "bookings_cancel": Row(
        BOOK,
        "/bookings/{booking}",
        (
            "200 200 not_found 200 200",
            "not_yours not_yours 200 not_found 200",
            "not_found not_found not_found not_found 200",
        ),
        version=True,
    ),
    "bookings_hand_over": Row(
        BOOK,
        "/bookings/{booking}/hand-over",
        (
            "200 200 not_found 200 200",
            "not_yours not_yours 200 not_found 200",
            "not_found not_found not_found not_found role_too_low",
        ),
        {"to": "colleague"},
        version=True,
    ),
    "hand_offers_list": Row(READ, "/hand-offers", everywhere("200")),
    "hand_offers_accept": Row(
        BOOK,
        "/hand-offers/{offer}/accept",
        (
            "role_too_low 200 not_found 200 200",
            "offer_over offer_over offer_over not_found offer_over",  # an offer to another person
            "not_found not_found not_found not_found offer_over",
        ),
    ),
    "hand_offers_end": Row(
        BOOK,
        "/hand-offers/{offer}",
        (
            "204 204 not_found 204 204",
            "not_yours not_yours 204 not_found 204",
            "not_found not_found not_found not_found 204",
        ),
    ),
    "bookings_approve": Row(
        BOOK,
        "/bookings/{awaiting}/approve",
        (
            "not_yours not_yours not_found 200 200",
            "not_yours not_yours 200 not_found 200",
            "not_found not_found not_found not_found 200",
        ),
        version=True,
    ),
    "bookings_accept": Row(
        BOOK,
        "/bookings/{offered}/accept",
        (
            "role_too_low 200 not_found 200 200",
            "offer_over offer_over offer_over not_found offer_over",  # an offer to another person
            "not_found not_found not_found not_found offer_over",
        ),
    ),
    "lesson_read": Row(READ, "/bookings/{team}/lesson", LED),
    "lesson_join": Row(
        BOOK,
        "/bookings/{team}/lesson/line",
        (
            "200 200 not_found 200 200",
            "not_in_lesson not_in_lesson not_in_lesson not_found not_in_lesson",
            "not_found not_found not_found not_found not_in_lesson",
        ),
    ),
    "lesson_leave": Row(BOOK, "/bookings/{team}/lesson/line", LED),
    "lesson_call": Row(BOOK, "/bookings/{team}/lesson/call", TAUGHT, {"username": "{turns}"}),
    "lesson_fill": Row(BOOK, "/bookings/{team}/lesson/everybody", TAUGHT),
    "lesson_spread": Row(BOOK, "/bookings/{team}/lesson/spread", TAUGHT),
    "lesson_tasks": Row(
        BOOK,
        "/bookings/{team}/lesson/tasks",
        tuple(line.replace("200", "no_lesson") for line in TAUGHT),
        {"max_share": 0.5},
    ),
    "lesson_take_back": Row(BOOK, "/bookings/{team}/lesson/hold", TAUGHT),
    "lesson_give_back": Row(BOOK, "/bookings/{team}/lesson/hold", TAUGHT),
    "lesson_extend": Row(BOOK, "/bookings/{team}/lesson/turns/{turn}", TAUGHT, {"minutes": 5}),
    "lesson_skip": Row(BOOK, "/bookings/{team}/lesson/turns/{turn}", TAUGHT),
    "waiting_list": Row(READ, "/waiting", everywhere("200")),
    "waiting_join": Row(
        BOOK,
        "/waiting",
        (
            "role_too_low free not_found free free",
            "role_too_low free free not_found free",
            "not_found not_found not_found not_found free",
        ),
        {"robot": "{robot}", **SLOT},
    ),
    "waiting_leave": Row(
        BOOK,
        "/waiting/{waiting}",
        (
            "204 204 not_found 204 204",
            everywhere("not_found")[0],
            everywhere("not_found")[0],
        ),
    ),
    # courses: the teacher's, and another person's
    "courses_list": Row(MANAGE, "/courses", everywhere("200")),
    "courses_read": Row(MANAGE, "/courses/{course}", managed("200")),
    "courses_marks": Row(MANAGE, "/courses/{course}/marks", managed("200")),
    "members_list": Row(MANAGE, "/courses/{course}/members", managed("200")),
    "members_enrol": Row(
        MANAGE, "/courses/{course}/members", managed("200"), {"list": "A <a@example.org>", "preview": True}
    ),
    "members_remove": Row(MANAGE, "/courses/{course}/members/{member}?confirm=yes", managed("204")),
    "qualifications_grant": Row(
        MANAGE,
        "/courses/{course}/qualifications/induction/grant?confirm=yes",
        managed("200"),
        {"people": None},
    ),
    "qualifications_revoke": Row(
        MANAGE,
        "/courses/{course}/qualifications/induction/revoke?confirm=yes",
        managed("200"),
        {"people": None},
    ),
    # records: one's own, a student's on the robot of the course, a stranger's on another robot
    "sessions_list": Row(READ, "/sessions?robot={robot}", OWN_STAY),
    "sessions_read": Row(
        READ,
        "/sessions/{session}",
        (
            everywhere("200")[0],
            "not_found not_found 200 not_found 200",
            "not_found not_found not_found not_found 200",
        ),
    ),
    # recording a robot; the bridge does not run here
    "recording_begin": Row(TOPICS, "/robots/{robot}/recordings", RECORDER, {}),
    "recording_end": Row(TOPICS, f"/robots/{{robot}}/recordings/{uuid4()}", RECORDER),
    "recording_keep_this": Row(TOPICS, "/robots/{robot}/keep-this", RECORDER, {}),
    # recordings: one's own, a student's, a stranger's. Their files are on a computer that is out of reach
    "recordings_list": Row(READ, "/recordings?robot={robot}", everywhere("200")),
    "recordings_read": Row(READ, "/recordings/{recording}", recorded("recording_away")),
    "recordings_views": Row(TOPICS, "/recordings/{recording}/views?from=0&to=1", recorded("recording_away")),
    "recordings_picture": Row(
        TOPICS, "/recordings/{recording}/picture?topic=/a&at=0", recorded("recording_away")
    ),
    "recordings_series": Row(
        TOPICS, "/recordings/{recording}/series?topic=/a&field=b&from=0&to=1", recorded("recording_away")
    ),
    "recordings_file": Row(TOPICS, "/recordings/{recording}/file", recorded("recording_away")),
    "recordings_thumbnail": Row(READ, "/recordings/{recording}/thumbnail", recorded("recording_away")),
    "recordings_keep": Row(MANAGE, "/recordings/{recording}/kept", recorded("204"), {"kept": True}),
    "recordings_share": Row(
        MANAGE, "/recordings/{recording}/shares", recorded("201"), {"person": "colleague"}
    ),
    "recordings_unshare": Row(MANAGE, "/recordings/{recording}/shares/{share}", recorded("204")),
    "recordings_delete": Row(MANAGE, "/recordings/{recording}", recorded("204")),
    "audit_list": Row(READ, "/audit?robot={robot}", OWN_STAY),
    "audit_read": Row(
        READ,
        "/audit/{task}",
        (
            everywhere("200")[0],
            "not_found not_found not_found not_found 200",
            "not_found not_found not_found not_found 200",
        ),
    ),
    "own_data_export": Row(READ, "/own-data", everywhere("200")),
    "audit_export": Row(READ, "/audit/export?format=csv", staff_only("200")),
    # registry
    "profiles_list": Row(READ, "/profiles", everywhere("200")),
    "registry_add": Row(
        MANAGE,
        "/registry",
        staff_only("201"),
        {"name": "New", "profile": "tiago", "master_uri": "http://127.0.0.1:9"},
    ),
    "registry_read": Row(MANAGE, "/registry/{robot}", staff_only("200")),
    "registry_change": Row(
        MANAGE,
        "/registry/{robot}?confirm=yes",
        staff_only("changed"),
        {"enabled": False},
        version=True,
    ),
    "registry_phrases_read": Row(READ, "/registry/{robot}/phrases", seen("200")),
    "registry_phrases_set": Row(
        MANAGE, "/registry/{robot}/phrases", staff_only("changed"), {"phrases": []}, version=True
    ),
    "registry_role_set": Row(
        MANAGE, "/registry/{robot}/roles/colleague?confirm=yes", staff_only("200"), {"role": "observer"}
    ),
    "registry_role_remove": Row(MANAGE, "/registry/{robot}/roles/colleague?confirm=yes", staff_only("204")),
    "profiles_read": Row(READ, "/profiles/tiago", everywhere("200")),
    "profiles_change": Row(
        MANAGE, "/profiles/tiago", staff_only("changed"), {"forward_mps": 0.5}, version=True
    ),
    "profiles_phrases_read": Row(READ, "/profiles/tiago/phrases", everywhere("200")),
    "profiles_phrases_set": Row(
        MANAGE, "/profiles/tiago/phrases", staff_only("changed"), {"phrases": []}, version=True
    ),
    # policies, out of service, series
    "policies_list": Row(READ, "/policies", everywhere("200")),
    "policies_read_common": Row(READ, "/policies/all", everywhere("200")),
    "policies_set_common": Row(
        MANAGE, "/policies/all?confirm=yes", staff_only("changed"), RULES, version=True
    ),
    "policies_read_robot": Row(READ, "/policies/robots/{robot}", seen("200")),
    "policies_set_robot": Row(
        MANAGE, "/policies/robots/{robot}?confirm=yes", robot_managed("changed"), RULES, version=True
    ),
    "policies_remove_robot": Row(MANAGE, "/policies/robots/{robot}?confirm=yes", robot_managed("204")),
    "policies_read_group": Row(READ, "/policies/groups/{group}", staff_only("200")),
    "policies_set_group": Row(
        MANAGE, "/policies/groups/{group}?confirm=yes", staff_only("changed"), RULES, version=True
    ),
    "policies_remove_group": Row(MANAGE, "/policies/groups/{group}?confirm=yes", staff_only("204")),
    "changes_list": Row(MANAGE, "/changes", everywhere("200")),
    "changes_undo": Row(
        MANAGE,
        "/changes/{change}/undo?confirm=yes",
        (
            everywhere(*["permission_denied"] * 4, "200")[0],  # it closes an account
            *[everywhere(*["not_found"] * 4, "200")[0]] * 2,
        ),
    ),
    "out_of_service_list": Row(READ, "/out-of-service", everywhere("200")),
    "out_of_service_add": Row(
        MANAGE, "/out-of-service?confirm=yes", robot_managed("201"), {"robot": "{robot}", "why": "repair"}
    ),
    "out_of_service_end": Row(
        MANAGE,
        "/out-of-service/{period}",
        (
            "not_found not_found not_found 204 204",
            "not_found not_found not_found not_found 204",
            "not_found not_found not_found not_found 204",
        ),
    ),
    "holidays_list": Row(READ, "/holidays", everywhere("200")),
    "holidays_add": Row(
        MANAGE,
        "/holidays",
        staff_only("201"),
        {"holidays": [{"name": "May Day", "first_day": "2027-05-01"}]},
    ),
    "holidays_remove": Row(MANAGE, "/holidays/{holiday}", staff_only("204")),
    "bookings_series": Row(
        BOOK,
        "/bookings/series",
        (
            "permission_denied permission_denied not_found 200 200",
            "permission_denied permission_denied 200 not_found 200",
            "not_found not_found not_found not_found 200",
        ),
        {"robot": "{robot}", "weeks": 2, "purpose": "Lab course", **SLOT},
    ),
    "bookings_series_read": Row(READ, "/bookings/series/{series}", SERIES),
    "bookings_series_move": Row(BOOK, "/bookings/series/{series}", SERIES, {"begins": "10:00"}),
    "bookings_series_cancel": Row(BOOK, "/bookings/series/{series}", SERIES),
    # set-up of courses: the teacher's, and another person's
    "courses_make": Row(
        MANAGE, "/courses", staff_only("201"), {"name": "New", "robots": ["{robot}"], **TERM}
    ),
    "courses_change": Row(
        MANAGE, "/courses/{course}?confirm=yes", staff_only("changed"), {"name": "New"}, version=True
    ),
    "courses_welcome": Row(MANAGE, "/courses/{course}/welcome", managed("200"), {"people": None}),
    "invitations_list": Row(MANAGE, "/courses/{course}/invitations", managed("200")),
    "invitations_make": Row(
        MANAGE, "/courses/{course}/invitations", managed("201"), {"last_day": TERM["ends_on"]}
    ),
    "invitations_revoke": Row(MANAGE, "/courses/{course}/invitations/{invitation}", managed("204")),
    # groups and qualifications
    "groups_list": Row(MANAGE, "/robot-groups", staff_only("200")),
    "groups_make": Row(MANAGE, "/robot-groups", staff_only("201"), {"name": "New", "robots": ["{robot}"]}),
    "groups_read": Row(MANAGE, "/robot-groups/{group}", staff_only("200")),
    "groups_change": Row(
        MANAGE, "/robot-groups/{group}?confirm=yes", staff_only("changed"), {"name": "New"}, version=True
    ),
    "groups_delete": Row(MANAGE, "/robot-groups/{group}?confirm=yes", staff_only("204")),
    "groups_role_set": Row(
        MANAGE, "/robot-groups/{group}/roles/colleague?confirm=yes", staff_only("200"), {"role": "observer"}
    ),
    "groups_role_remove": Row(MANAGE, "/robot-groups/{group}/roles/colleague?confirm=yes", staff_only("204")),
    "qualifications_list": Row(MANAGE, "/qualifications", staff_only("200")),
    "qualifications_make": Row(
        MANAGE, "/qualifications?confirm=yes", staff_only("201"), {"name": "New", "robots": ["{robot}"]}
    ),
    "qualifications_read": Row(MANAGE, "/qualifications/induction", staff_only("200")),
    "qualifications_change": Row(
        MANAGE, "/qualifications/induction?confirm=yes", staff_only("changed"), {"name": "New"}, version=True
    ),
    "qualifications_delete": Row(MANAGE, "/qualifications/induction", staff_only("204")),
    # tokens: one's own, a student's, a stranger's
    "tokens_list": Row(READ, "/tokens", everywhere("200")),
    "tokens_make": Row(MANAGE, "/tokens", seen("201"), {**TOKEN, "robots": ["{robot}"]}),
    "tokens_end": Row(
        MANAGE,
        "/tokens/{token}",
        (
            everywhere("204")[0],
            "not_found not_found not_found not_found 204",
            "not_found not_found not_found not_found 204",
        ),
    ),
    "service_accounts_list": Row(MANAGE, "/service-accounts", staff_only("200")),
    "service_accounts_make": Row(
        MANAGE, "/service-accounts", staff_only("201"), {"name": "New", "project": "Grasping"}
    ),
    "service_tokens_list": Row(MANAGE, "/service-accounts/night-tests/tokens", staff_only("200")),
    "service_tokens_make": Row(MANAGE, "/service-accounts/night-tests/tokens", staff_only("201"), TOKEN),
    # webhooks for the robot
    "webhooks_list": Row(MANAGE, "/webhooks", staff_only("200")),
    "webhooks_make": Row(
        MANAGE,
        "/webhooks",
        staff_only("201"),
        {"name": "new", "address": "https://a.example.org", "kinds": ["stops"], "robots": ["{robot}"]},
        also=READ,
    ),
    "webhooks_read": Row(MANAGE, "/webhooks/{webhook}", staff_only("200")),
    "webhooks_change": Row(MANAGE, "/webhooks/{webhook}", staff_only("200"), {"paused": True}),
    "webhooks_delete": Row(MANAGE, "/webhooks/{webhook}", staff_only("204")),
    "webhooks_deliveries": Row(MANAGE, "/webhooks/{webhook}/deliveries", staff_only("200")),
    "webhooks_test": Row(MANAGE, "/webhooks/{webhook}/test", staff_only("204")),
    "webhooks_again": Row(MANAGE, "/webhooks/{webhook}/again", staff_only("200")),
}


# --- the lab ------------------------------------------------------------------------------------------


class Lab:
    """Robots, people, courses, and for each person and place an object of each kind."""

    def __init__(self, profile: RobotProfile) -> None:
        self.robots = {
            place: Robot.objects.create(
                slug=place, name=place, profile=profile, master_uri="http://127.0.0.1:9"
            )
            for place in PLACES
        }
        names = (*PEOPLE, "student", "stranger", "colleague")
        self.people = {name: User.objects.create_user(name, is_staff=name == "staff") for name in names}
        staff = self.people["staff"]
        for name in ("observer", "operator", "supervisor"):
            role_set(robot=self.robots["own"], user=self.people[name], role=Role(name), actor=staff)
        for robot in (self.robots["own"], self.robots["course"]):
            role_set(robot=robot, user=self.people["colleague"], role=Role.OPERATOR, actor=staff)
        self._demand_induction()
        self._course("watchers", "course", Role.OBSERVER, ["observer"], [])
        mine = self._course("mine", "course", Role.OPERATOR, ["operator", "student"], ["teacher"])
        theirs = self._course("theirs", "other", Role.OPERATOR, ["stranger"], [])
        service_account_make(name="Night tests", project="Grasping", actor=staff)
        self.groups, self.webhooks, self.places, self.layouts = {}, {}, {}, {}
        for place, robot in self.robots.items():
            kitchen = PlaceEntry("kitchen", 1.0, 1.0)
            self.places[place] = place_add(digest=map_of(robot, mark=place), entry=kitchen, actor=staff)
            self.layouts[place] = SharedLayout.objects.create(robot=robot, name="Survey", panels=[])
            self.groups[place] = RobotGroup.objects.create(name=f"Robots {place}", slug=f"robots-{place}")
            self.groups[place].robots.add(robot)
            self.webhooks[place], _ = webhook_make(
                name=place, address="https://hooks.example.org", kinds=["stops"], robots=[robot], actor=staff
            )
        self.courses = {"own": mine, "course": mine, "other": theirs}
        self.holiday = Holiday.objects.create(name="Far", first_day="2199-01-01", last_day="2199-01-01")
        self._number = 0
        self.objects = {(who, place): self._objects(who, place) for who in PEOPLE for place in PLACES}

    def _demand_induction(self) -> None:
        """All robots demand the safety induction, and all people have it."""
        induction = Qualification.objects.create(name="Safety induction", slug="induction")
        induction.robots.set(self.robots.values())
        qualification_grant(
            qualification=induction,
            people=list(self.people.values()),
            expires_at=None,
            actor=self.people["staff"],
        )

    def _course(self, slug: str, robot: str, role: Role, people: list[str], supervisors: list[str]) -> Course:
        course = Course.objects.create(
            name=slug, slug=slug, role=role, starts_on=lab_date(), ends_on=lab_date() + timedelta(days=30)
        )
        course.robots.add(self.robots[robot])
        course.supervisors.set([self.people[name] for name in supervisors])
        for name in people:
            Enrolment.objects.create(course=course, person=self.people[name])
        return course

    def _objects(self, who: str, place: str) -> dict[str, str]:
        """Return the objects that replace `{...}`."""
        owner = self.people[{"own": who, "course": "student", "other": "stranger"}[place]]
        robot, course = self.robots[place], self.courses[place] if place != "own" else None
        self._number += 1
        starts_at = hour(24 * 4 + 2 * self._number)
        times = {"starts_at": starts_at, "ends_at": starts_at + timedelta(hours=1)}
        booked = self._booking(robot, owner, course, State.BOOKED, **times)
        awaiting, offered = (
            self._booking(
                robot, owner, course, state, **{key: at + timedelta(days=days) for key, at in times.items()}
            )
            for state, days in ((State.AWAITING, 40), (State.OFFERED, 80))
        )
        hers = self._booking(
            robot,
            self.people["colleague"],
            course,
            State.BOOKED,
            **{key: at + timedelta(days=12) for key, at in times.items()},
        )
        offer = HandOffer.objects.create(
            booking=hers,
            version=1,
            by=self.people["colleague"],
            to=owner,
            made_at=timezone.now(),
            until=starts_at,
        )
        change = Change.objects.create(
            actor=owner,
            made_at=timezone.now(),
            kind="policy.change",
            rows=[{"table": "accounts.User", "key": str(owner.pk), "before": {}, "after": {}}],
            losses=[{"booking": str(booked.pk), "how": "useless"}],
        )
        later = {key: at + timedelta(days=120) for key, at in times.items()}
        weekly = self._booking(robot, owner, course, State.BOOKED, **later)
        Booking.objects.filter(pk=weekly.pk).update(series=weekly.pk)
        weekly.series = weekly.pk
        later = {key: at + timedelta(days=160) for key, at in times.items()}
        team = self._booking(robot, owner, course, State.BOOKED, **later)
        Booking.objects.filter(pk=team.pk).update(shared="people", turn_min=10)
        turn = team.turns.create(person=owner, number=1)
        waiting = Waiting.objects.create(robot=robot, person=owner, since=timezone.now(), **times)
        session = ControlSession.objects.create(
            robot=robot, user=owner, fence=self._number, started_at=timezone.now(), ended_at=timezone.now()
        )
        recording = Recording.objects.create(
            robot=robot,
            person=owner,
            kind="by_hand",
            begins_at=timezone.now(),
            ends_at=timezone.now(),
            file="a.mcap",
            thumbnail=True,
        )
        share = RecordingShare.objects.create(
            recording=recording, person=self.people["staff"], made_at=timezone.now()
        )
        task = record("motion.start", actor=owner, robot_id=robot.id, robot_name=robot.name)
        period = OutOfService.objects.create(
            robot=robot,
            starts_at=timezone.now() + timedelta(days=200),
            ends_at=timezone.now() + timedelta(days=201),
            why="repair",
        )
        invitation = invitation_make(
            course=self.courses[place], expires_at=times["ends_at"], most_uses=5, actor=self.people["staff"]
        )
        token, _ = token_make(
            user=owner, name=place, scopes=[Scope.READ], expires_at=times["ends_at"], actor=owner
        )
        return {
            "robot": place,
            "map": self.places[place].map_id,
            "place": str(self.places[place].pk),
            "layout": str(self.layouts[place].pk),
            "group": self.groups[place].slug,
            "webhook": str(self.webhooks[place].pk),
            "period": str(period.pk),
            "holiday": str(self.holiday.pk),
            "invitation": str(invitation.pk),
            "token": str(token.pk),
            "booking": str(booked.pk),
            "series": str(weekly.series),
            "change": str(change.pk),
            "offer": str(offer.pk),
            "awaiting": str(awaiting.pk),
            "offered": str(offered.pk),
            "team": str(team.pk),
            "turn": str(turn.pk),
            "turns": owner.username,
            "waiting": str(waiting.pk),
            "session": str(session.pk),
            "recording": str(recording.pk),
            "share": str(share.pk),
            "task": str(task.pk),
            "course": self.courses[place].slug,
            "member": "stranger" if place == "other" else "student",
        }

    @staticmethod
    def _booking(
        robot: Robot, owner: User, course: Course | None, state: State, starts_at: datetime, ends_at: datetime
    ) -> Booking:
        return Booking.objects.create(
            robot=robot,
            person=owner,
            course=course,
            starts_at=starts_at,
            ends_at=ends_at,
            held_until=ends_at,
            state=state,
            made_at=timezone.now(),
            offer_until=starts_at if state is State.OFFERED else None,
        )


def program(person: User, scopes: Sequence[Scope]) -> Caller:
    """Return a program with a token of the person with these scopes."""
    expires = timezone.now() + timedelta(days=1)
    _, text = token_make(user=person, name="program", scopes=scopes, expires_at=expires, actor=person)
    return Caller(Client(), {"Authorization": f"Bearer {text}"})


def browser(person: User) -> Caller:
    """Return the person's browser, which needs no scopes."""
    client = Client()
    client.force_login(person)
    session = client.session  # the password was given just now
    session[AUTHENTICATION_METHODS_SESSION_KEY] = [{"method": "password", "at": time.time()}]
    session.save()
    return Caller(client, {})


@contextmanager
def undone() -> Iterator[None]:
    """Roll back all changes of the database."""
    with transaction.atomic():
        yield
        transaction.set_rollback(True)


def filled(value: Any, objects: dict[str, str]) -> Any:
    """Replace `{...}` by objects."""
    if isinstance(value, dict):
        return {name: filled(one, objects) for name, one in value.items()}
    if isinstance(value, list):
        return [filled(one, objects) for one in value]
    return re.sub(r"{(\w+)}", lambda match: objects[match[1]], value) if isinstance(value, str) else value


@cache
def paths() -> dict[str, dict[str, Any]]:
    """Return the operations of the schema by path and method."""
    return {
        path.removeprefix("/api/v1"): methods
        for path, methods in json.loads(OPENAPI.read_text())["paths"].items()
    }


def operations() -> dict[str, tuple[str, str]]:
    """Return the operations of the schema: method and path by name."""
    return {
        operation["operationId"]: (method.upper(), path)
        for path, methods in paths().items()
        for method, operation in methods.items()
    }


@cache
def table() -> dict[str, Row]:
    """Return all rows: kinds of tasks with one address need none of their own, unless their request does."""
    of_tasks = {
        operation["operationId"]: Row(
            (Scope(kind.scope),), f"/robots/{{robot}}/{kind.address}", NO_LEASE, example(operation)
        )
        for kind in TASK_KINDS
        for operation in paths().get(f"/robots/{{slug}}/{kind.address}", {}).values()
    }
    return of_tasks | TABLE


def example(operation: dict[str, Any]) -> Any:
    """Return the first example of an operation's body; None if it has no body."""
    for content in operation.get("requestBody", {}).get("content", {}).values():
        return next((one["value"] for one in content.get("examples", {}).values()), {})
    return None


def stopped(robots: Sequence[Robot], **_press: Any) -> emergency_stop.Outcomes:
    """Return that all robots stopped. This test has no robots, and each press would wait for one."""
    return {robot: StopState("stopped") for robot in robots}


class Door:
    """Calls operations."""

    def __init__(self, methods: dict[str, tuple[str, str]]) -> None:
        self._methods = methods

    def __call__(self, name: str, caller: Caller, objects: dict[str, str]) -> str:
        """Return the status of success, or the code of the refusal."""
        row = table()[name]
        headers = {"If-Match": '"1"'} if row.version else {}
        with undone():
            answer = caller.stream(
                self._methods[name][0], filled(row.path, objects), filled(row.body, objects), **headers
            )
        if answer.status_code < 300:
            return str(answer.status_code)
        code = str(answer.json()["code"])
        expected = {"not_found": 404, "scope_missing": 403, "permission_denied": 403, "signed_out": 401}
        assert answer.status_code == expected.get(code, answer.status_code), (name, code, answer.status_code)
        return code


@pytest.fixture
def lab(tiago: RobotProfile) -> Lab:
    return Lab(tiago)


def test_each_operation_of_the_schema_has_a_row() -> None:
    methods = operations()
    assert set(table()) == set(methods)
    for name, row in table().items():
        asked = row.path.partition("?")[0]
        assert re.fullmatch(re.sub(r"{\w+}", "[^/]+", methods[name][1]), asked), name


class Check:
    """Compares the results of a person's operations with the table."""

    def __init__(self, lab: Lab) -> None:
        self.wrong: list[str] = []
        self._lab, self._door = lab, Door(operations())

    def nobody(self, name: str) -> None:
        """Ask for an operation without sign-in."""
        found = self._door(name, Caller(Client(), {}), self._lab.objects["operator", "own"])
        if found != "signed_out":
            self.wrong.append(f"{name} without sign-in: {found}")

    def __call__(
        self, who: str, name: str, scopes: Sequence[Scope] | None, caller: Caller, place: str
    ) -> None:
        """Ask for an operation at a place. A browser has no `scopes` (None)."""
        row = table()[name]
        expected = row.ends[PLACES.index(place)].split()[PEOPLE.index(who)]
        opens = scopes is None or not row.scopes or any(scope in scopes for scope in row.scopes)
        needs_more = expected.isdigit() and scopes is not None and not set(row.also) <= set(scopes)
        if not opens or needs_more:
            expected = "scope_missing"
        found = self._door(name, caller, self._lab.objects[who, place])
        if found != expected:
            self.wrong.append(f"{name} by {who} ({scopes}) in {place}: {found}, not {expected}")


@pytest.fixture
def check(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> Iterator[Check]:
    """The check of a test, which fails at its end if a result was wrong."""
    monkeypatch.setattr(refusals, "record_soon", lambda _refused: None)
    monkeypatch.setattr(emergency_stop, "press_once", stopped)
    check = Check(lab)
    yield check
    assert not check.wrong, f"{len(check.wrong)}:\n" + "\n".join(check.wrong)


@pytest.mark.django_db
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")
def test_role_operation_and_place_decide(lab: Lab, check: Check) -> None:
    """Each person uses a program with all scopes and a browser, in turn.

    Where all places have the same result for a person, the person tries one place, in turn.
    """
    every = tuple(Scope)
    for number, who in enumerate(PEOPLE):
        person = lab.people[who]
        found = {place: role for place, robot in lab.robots.items() if (role := role_on(person, robot))}
        assert found == ROLES[who]
        doors = cycle([(every, program(person, every)), (None, browser(person))])
        for turn, (name, row) in enumerate(table().items(), number):
            same = len({ends.split()[number] for ends in row.ends}) == 1
            for place in [PLACES[turn % len(PLACES)]] if same else PLACES:
                check(who, name, *next(doors), place)
    for name in table():
        check.nobody(name)


@pytest.mark.django_db
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")
@pytest.mark.parametrize("who", PEOPLE)
def test_scope_and_operation_decide(who: str, lab: Lab, check: Check) -> None:
    """Each scope of an operation opens it alone, and all others together do not."""
    programs = dict[tuple[Scope, ...], Caller]()
    for turn, (name, row) in enumerate(table().items(), PEOPLE.index(who)):
        place = PLACES[turn % len(PLACES)]
        others = tuple(scope for scope in Scope if scope not in row.scopes)
        for scopes in [*((scope,) for scope in row.scopes), others if row.scopes else ()]:
            if scopes not in programs:
                programs[scopes] = program(lab.people[who], scopes)
            check(who, name, scopes, programs[scopes], place)
