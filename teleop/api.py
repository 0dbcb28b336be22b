"""REST for lab tooling: the robots, how they are, and the stop. What is refused is explained like everywhere else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import msgspec
from django.shortcuts import get_object_or_404
from django.utils import timezone
from rest_framework.exceptions import APIException
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView, exception_handler

from fleet.accounts.models import User
from robots.link import LinkRefused, hello_once
from robots.models import Robot
from robots.selectors import link_address, robot_facts, robots_visible_to, role_on
from robots.wire import Refusal
from teleop import rules, stopping
from teleop.policy import out_of_service
from teleop.selectors import holding_of


def explained(error: Exception, context: dict[str, Any]) -> Response | None:
    """Every error as a refusal: a code for programs, a sentence for people, the rule behind it."""
    response = exception_handler(error, context)
    if response is None:
        return None
    known = isinstance(error, APIException)
    code = cast(APIException, error).default_code if known else "not_found"
    text = (
        str(cast(APIException, error).detail) if known else "There is no such robot, or you may not see it."
    )
    rule = "account" if response.status_code in (401, 403) else "wire"
    response.data = msgspec.to_builtins(Refusal(code, text, rule))
    return response


class FleetApi(APIView):
    """What the addresses below have in common."""

    def get_exception_handler(self) -> Callable[[Exception, dict[str, Any]], Response | None]:
        """Explain refusals."""
        return explained

    def person(self) -> User:
        """Who asks."""
        return cast(User, self.request.user)

    def visible(self, slug: str) -> Robot:
        """The robot, if the person may see it; else 404."""
        return get_object_or_404(robots_visible_to(self.person()), slug=slug)

    def stop(self, robots: Sequence[Robot]) -> Response:
        """Stop at once; 502 if one of them was not reached."""
        results = stopping.press_once(robots, user=self.person(), through="rest")
        unreached = any(isinstance(result, Refusal) for result in results)
        outcomes = {
            robot.slug: msgspec.to_builtins(result) for robot, result in zip(robots, results, strict=True)
        }
        return Response({"robots": outcomes}, status=502 if unreached else 200)


class RobotList(FleetApi):
    """GET: the robots that this person may see."""

    def get(self, request: Request) -> Response:
        """Names and roles; how a robot is, its own address tells."""
        return Response([entry(robot, self.person()) for robot in robots_visible_to(self.person())])


class RobotDetail(FleetApi):
    """GET: one robot, and how it is as far as its bridge knows."""

    def get(self, request: Request, slug: str) -> Response:
        """Facts, holder, state; `refusal` says why the state is not known."""
        robot = self.visible(slug)
        holding = holding_of(robot.id)
        held = holding is not None and rules.lapse(holding, timezone.now()) is None
        state, refusal = _state(robot)
        return Response(
            {
                **entry(robot, self.person()),
                "facts": msgspec.to_builtins(robot_facts(robot)),
                "holder": holding.name if holding and held else None,
                "state": msgspec.to_builtins(state),
                "refusal": msgspec.to_builtins(refusal),
            }
        )


class RobotStop(FleetApi):
    """POST: emergency stop of one robot."""

    def post(self, request: Request, slug: str) -> Response:
        """Latched; cleared on the robot's page."""
        return self.stop([self.visible(slug)])


class Stop(FleetApi):
    """POST: emergency stop of every robot that this person may see."""

    def post(self, request: Request) -> Response:
        """Latched; cleared on each robot's page."""
        return self.stop(list(robots_visible_to(self.person()).filter(enabled=True)))


def entry(robot: Robot, user: User) -> dict[str, Any]:
    """A robot in a list."""
    role = role_on(user, robot)
    return {
        "slug": robot.slug,
        "name": robot.name,
        "profile": robot.profile.slug,
        "practice": robot.practice,
        "enabled": robot.enabled,
        "role": role.value if role else None,
    }


def _state(robot: Robot) -> tuple[object, Refusal | None]:
    try:
        return hello_once(link_address(robot)).state, None
    except LinkRefused as refused:
        return None, out_of_service(robot) or refused.refusal
