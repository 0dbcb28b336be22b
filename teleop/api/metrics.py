"""Metrics for Prometheus, behind a token: web, bridges, gate, as the pages process sees them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.utils import timezone
from prometheus_client import CollectorRegistry, Histogram
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector
from rest_framework.request import Request

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from fleet.bookings.models import Waiting
from robots.bridge.config import LinkAddress
from robots.link.client import LinkRefused, state_once
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.wire import Refusal, State
from teleop.api.v1.door.operation import ApiView, operation
from teleop.api.v1.door.problems import Problem
from teleop.control.selectors import held_leases

BUCKETS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
HOUR = timedelta(hours=1)

_STAFF_ONLY = Refusal("permission_denied", "Metrics are for staff and their service accounts.", "account")

registry = CollectorRegistry()
_seconds = Histogram(
    "fleet_http_request_seconds",
    "Time to answer a request, by route.",
    ["method", "route", "status"],
    buckets=BUCKETS_S,
    registry=registry,
)


def measured(
    get_response: Callable[[HttpRequest], HttpResponseBase],
) -> Callable[[HttpRequest], HttpResponseBase]:
    """Middleware: measure each request by its route, whose number is limited."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        began_s = time.perf_counter()
        response = get_response(request)
        match = request.resolver_match
        route = match.route if match else "none"
        method = (
            request.method if request.method in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE") else "other"
        )
        _seconds.labels(method, route, str(response.status_code)).observe(time.perf_counter() - began_s)
        return response

    return middleware


class RobotCollector(Collector):
    """Reads bridges and database at each scrape."""

    def collect(self) -> Iterator[Metric]:
        """Yield the figures of each robot in service."""
        robots = list(Robot.objects.filter(enabled=True))
        with ThreadPoolExecutor(max_workers=8) as pool:
            addresses = [(robot, link_address(robot)) for robot in robots]
            states = list(pool.map(lambda one: _state(*one), addresses))
        held = {robot_id for robot_id, _ in held_leases()}
        gauges = {
            name: GaugeMetricFamily(f"fleet_robot_{name}", words, labels=["robot"])
            for name, words in {
                "online": "1: the bridge has the robot's master, odometry and drive topic.",
                "held": "1: somebody has control.",
                "waiting": "People and programs in line for control.",
                "stopped": "1: the emergency stop is latched.",
                "gate_factor": "Part of the wished speed that the gate lets through now.",
                "gate_interventions_hour": "Interventions of the gate in the last hour.",
                "refused_messages": "Messages that the bridge refused since it was started.",
                "unseen_seconds": "Time since the robot's odometry last came.",
                "latency_seconds": "From a command to odometry that shows it.",
                "battery_percent": "Charge of the battery.",
            }.items()
        }
        since = timezone.now() - HOUR
        for robot, state in zip(robots, states, strict=True):
            figures: dict[str, float | None] = {
                "online": float(state is not None and state.phase == "online"),
                "held": float(robot.id in held),
                "waiting": float(Waiting.objects.filter(robot=robot, starts_at=None).count()),
                "gate_interventions_hour": float(
                    Record.objects.filter(kind="gate.begin", robot_id=robot.id, at__gt=since).count()
                ),
            }
            if state is not None:
                figures |= {
                    "stopped": float(state.stop.state != "clear"),
                    "gate_factor": _factor(state),
                    "refused_messages": float(sum(state.refused.values())),
                    "unseen_seconds": state.unseen_s,
                    "latency_seconds": state.latency_s,
                    "battery_percent": state.battery_percent,
                }
            for name, value in figures.items():
                if value is not None:
                    gauges[name].add_metric([robot.slug], value)
        yield from gauges.values()


def _factor(state: State) -> float:
    asked, allowed = (sum(abs(part) for part in one) for one in (state.verdict.asked, state.verdict.allowed))
    return min(1.0, allowed / asked) if asked > 0.0 else 1.0


def _state(robot: Robot, address: LinkAddress) -> State | None:
    try:
        return state_once(robot.id, address)
    except LinkRefused:
        return None


registry.register(RobotCollector())


class MetricsView(ApiView):
    """`/metrics`."""

    schema = None

    @operation("metrics", "Metrics", scope=Scope.READ)
    def get(self, _request: Request) -> HttpResponse:
        """In the text format of Prometheus."""
        if not self.person.is_staff:
            raise Problem(_STAFF_ONLY)
        return HttpResponse(generate_latest(registry), content_type=CONTENT_TYPE_PLAIN_0_0_4)
