"""REST views for pages and lab tooling: robots, their state, their phrases and speech.

Errors are refusals, as everywhere: a code, a sentence, a rule.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any, cast

import msgspec
from django.utils import timezone
from rest_framework.exceptions import APIException, AuthenticationFailed, NotAuthenticated, NotFound
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView, exception_handler

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from robots.access.selectors import robot_seen_by, robots_visible_to, role_on, roles_of
from robots.link.client import LinkRefused, state_once
from robots.registry.models import Robot, Role
from robots.registry.selectors import link_address, phrases_of, robot_facts
from robots.stop import courier
from robots.stop.pending_stops import name_of
from robots.wire import PendingStop, Refusal, Rule, State
from teleop.control import rules
from teleop.control.policy import out_of_service
from teleop.control.selectors import lease_of
from teleop.recording import refusals
from teleop.recording.refusals import RefusedRequest
from teleop.reports.history import speech_history

LONGEST_PAGE = 200  # entries of history at once
HIGHEST_NUMBER = 2**63 - 1
SIGNED_OUT = Refusal("signed_out", "Not done: you are signed out. Sign in again.", "account")


class BadQuery(APIException):
    """A query parameter is not valid."""

    status_code = 400
    default_code = "invalid"


def refusal_response(error: Exception, context: dict[str, Any]) -> Response | None:
    """Answer an error with a refusal: a code for programs, a sentence for people, the rule behind it."""
    response = exception_handler(error, context)
    if response is None:
        return None
    if isinstance(error, NotAuthenticated | AuthenticationFailed):
        return Response(msgspec.to_builtins(SIGNED_OUT), status=401)
    known = isinstance(error, APIException)
    code = cast(APIException, error).default_code if known else "not_found"
    text = (
        str(cast(APIException, error).detail) if known else "There is no such robot, or you may not see it."
    )
    rule: Rule = "account" if response.status_code == 403 else "wire"
    refusal = Refusal(code, text, rule)
    response.data = msgspec.to_builtins(refusal)
    _record(refusal, context["request"])
    return response


def _record(refusal: Refusal, request: Request) -> None:
    """Record a refusal for a signed-in person.

    Some requests are refused before their person is known, and finding out may fail as well (a forged request).
    """
    try:
        person = request.user
    except APIException:
        return
    if isinstance(person, User):
        match = request.resolver_match
        asked = f"{request.method} {match.route if match else ''}".strip()
        refusals.record_soon(RefusedRequest(person, "rest", asked, refusal))


class FleetApi(APIView):
    """Base of the views below."""

    def get_exception_handler(self) -> Callable[[Exception, dict[str, Any]], Response | None]:
        """Answer errors with refusals."""
        return refusal_response

    def person(self) -> User:
        """Return the person of the request."""
        return person_of(self.request)

    def visible(self, slug: str) -> Robot:
        """Return the robot if the person may see it; else 404."""
        return robot_seen_by(self.person(), slug)

    def number(self, name: str, default: int, most: int) -> int:
        """Return a query parameter that is a whole number from 1 to `most`."""
        given = self.request.query_params.get(name, str(default))
        if not (re.fullmatch("[0-9]{1,19}", given) and 1 <= int(given) <= most):
            raise BadQuery(f"{name} must be a whole number from 1 to {most}.")
        return int(given)


class RobotList(FleetApi):
    """GET: the robots that this person may see."""

    def get(self, request: Request) -> Response:
        """Return names and roles; the state of a robot is at its own address."""
        robots = list(robots_visible_to(self.person()))
        roles = roles_of(self.person(), robots)
        return Response([entry(robot, roles.get(robot.id)) for robot in robots])


class RobotDetail(FleetApi):
    """GET: one robot and its state, as far as its bridge knows it."""

    def get(self, request: Request, slug: str) -> Response:
        """Return facts, holder and state; `refusal` says why the state is unknown."""
        robot = self.visible(slug)
        lease = lease_of(robot.id)
        held = lease is not None and rules.lapse_reason(lease, timezone.now()) is None
        state, refusal = _state(robot)
        seen_at = _seen_at(state)
        return Response(
            {
                **entry(robot, role_on(self.person(), robot)),
                "facts": msgspec.to_builtins(robot_facts(robot)),
                "holder": lease.name if lease and held else None,
                "state": msgspec.to_builtins(state),
                "seen_at": seen_at.isoformat(timespec="seconds") if seen_at else None,
                "refusal": msgspec.to_builtins(refusal),
                "pending_stop": msgspec.to_builtins(_pending(robot)),
            }
        )


class RobotPhrases(FleetApi):
    """GET: the phrases of one robot, in their order."""

    def get(self, request: Request, slug: str) -> Response:
        """Return each phrase with its language and tags."""
        lines = [(phrase.pk, phrase.line) for phrase in phrases_of(self.visible(slug))]
        return Response([{"id": number, **msgspec.to_builtins(line)} for number, line in lines])


class RobotSpeech(FleetApi):
    """GET: the history of one robot's speech, newest first, from the audit log.

    `limit` entries (50) with numbers below `before`. Only supervisors and staff get entries of other people.
    """

    def get(self, request: Request, slug: str) -> Response:
        """Return the entries; `more` says whether there are older ones."""
        robot = self.visible(slug)
        before = self.number("before", HIGHEST_NUMBER, HIGHEST_NUMBER)
        limit = self.number("limit", 50, LONGEST_PAGE)
        history = speech_history(robot, self.person(), before=before, limit=limit)
        return Response(msgspec.to_builtins(history))


class NoSuchAddress(FleetApi):
    """Any other address: 404."""

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> None:
        """Raise 404 with a sentence."""
        super().initial(request, *args, **kwargs)
        raise NotFound("There is no such address.")


def entry(robot: Robot, role: Role | None) -> dict[str, Any]:
    """Return a robot's entry in a list, with the person's role on it."""
    return {
        "slug": robot.slug,
        "name": robot.name,
        "profile": robot.profile.slug,
        "practice": robot.practice,
        "enabled": robot.enabled,
        "role": role.value if role else None,
    }


def _seen_at(state: State | None) -> datetime | None:
    """Return when the robot was last heard, as far as its bridge knows; REST has no link of its own that knows more."""
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
