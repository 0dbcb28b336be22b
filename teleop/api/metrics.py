"""Metrics for Prometheus, behind a token: all web processes of this computer, bridges, gate."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from itertools import chain
from typing import Any
from uuid import UUID

from django.db.models import Count, QuerySet
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter
from prometheus_client import CollectorRegistry, Histogram, Info, disable_created_metrics
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from fleet.base.version import commit, version
from fleet.bookings.models import Waiting
from robots.link.connections import LinkRefused
from robots.link.state_reader import AT_ONCE, figures_once
from robots.registry.models import Robot
from robots.registry.selectors import link_address
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.processes.durations import buckets
from robots.shared.wire import BridgeFigures, Refusal, State
from teleop.alerts.metrics import AlertCollector
from teleop.api.backup_metrics import BackupCollector
from teleop.api.v1.framework.operation import ApiView, operation
from teleop.api.v1.framework.problems import Problem
from teleop.api.web_processes import OWN, of_others
from teleop.control.selectors import held_leases

BUCKETS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)
HOUR = timedelta(hours=1)

_STAFF_ONLY = Refusal("permission_denied", "Metrics are for staff and their service accounts.", "account")

disable_created_metrics()  # type: ignore[no-untyped-call]  # nobody needs the creation time of each series
_own = CollectorRegistry()  # of this process
_seconds = Histogram(
    "fleet_http_request_seconds",
    "Time to answer a request, by route.",
    ["web", "method", "route", "status"],
    buckets=BUCKETS_S,
    registry=_own,
)


def measured(
    get_response: Callable[[HttpRequest], HttpResponseBase],
) -> Callable[[HttpRequest], HttpResponseBase]:
    """Middleware: measure the time of each request by route. The number of routes is limited."""

    def middleware(request: HttpRequest) -> HttpResponseBase:
        began_s = time.perf_counter()
        response = get_response(request)
        match = request.resolver_match
        route = match.route if match else "none"
        method = (
            request.method if request.method in ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE") else "other"
        )
        web = str(os.getppid())  # the web process, which started this one
        _seconds.labels(web, method, route, str(response.status_code)).observe(time.perf_counter() - began_s)
        return response

    return middleware


class RobotCollector(Collector):
    """The figures of all robots: each scrape reads the bridges and the database."""

    def collect(self) -> Iterator[Metric]:
        """Yield the figures of each robot in service."""
        robots = list(Robot.objects.filter(enabled=True).select_related("profile"))
        with ThreadPoolExecutor(max_workers=AT_ONCE) as pool:  # they wait for bridges
            addresses = [(robot, link_address(robot)) for robot in robots]
            answers = list(pool.map(lambda one: _answer(*one), addresses))
        held = {robot_id for robot_id, _ in held_leases()}
        waiting = _counts(Waiting.objects.filter(starts_at=None))
        since = timezone.now() - HOUR
        held_back = _counts(Record.objects.filter(kind="gate.begin", at__gt=since))
        gauges = {
            name: GaugeMetricFamily(f"fleet_robot_{name}", words, labels=["robot"])
            for name, words in {
                "online": "1: the bridge has the robot's master, odometry and drive topic.",
                "held": "1: somebody has control.",
                "waiting": "People and programs in line for control.",
                "stopped": "1: the emergency stop is latched.",
                "stops": "Presses of the emergency stop, ever.",
                "gate_factor": "Part of the wished speed that the gate lets through now.",
                "gate_interventions_hour": "Interventions of the gate in the last hour.",
                "refused_messages": "Messages that the bridge refused since it was started.",
                "unseen_seconds": "Time since the robot's odometry last came.",
                "latency_seconds": "From a command to odometry that shows it.",
                "battery_percent": "Charge of the battery.",
            }.items()
        }
        decisions = HistogramMetricFamily(
            "fleet_bridge_decision_seconds",
            "Drive messages, from reading one to its twist, since the bridge was started.",
            labels=["robot"],
        )
        interventions = CounterMetricFamily(
            "fleet_gate_interventions", "Of the gate, since the bridge was started.", labels=["robot"]
        )
        for robot, (figures_of_bridge, state) in zip(robots, answers, strict=True):
            if figures_of_bridge is not None:
                counts = buckets(figures_of_bridge.decisions)
                decisions.add_metric([robot.slug], counts, figures_of_bridge.decisions_s)
                interventions.add_metric([robot.slug], float(figures_of_bridge.interventions))
            figures: dict[str, float | None] = {
                "online": float(state is not None and state.phase == "online"),
                "held": float(robot.id in held),
                "waiting": float(waiting.get(robot.id, 0)),
                "gate_interventions_hour": float(held_back.get(robot.id, 0)),
            }
            if state is not None:
                figures |= {
                    "stopped": float(state.stop.state != "clear"),
                    "stops": float(state.stop.number),
                    "gate_factor": _factor(state),
                    "refused_messages": float(sum(state.refused.values())),
                    "unseen_seconds": state.unseen_s,
                    "latency_seconds": state.latency_s,
                    "battery_percent": state.battery_percent,
                }
            for name, value in figures.items():
                if value is not None:
                    gauges[name].add_metric([robot.slug], value)
        yield from (*gauges.values(), decisions, interventions)


def _counts(rows: QuerySet[Any]) -> dict[UUID, int]:
    """Return the number of rows of each robot. One query."""
    return dict(rows.order_by().values_list("robot_id").annotate(number=Count("pk")))


def _factor(state: State) -> float:
    asked, allowed = (sum(abs(part) for part in one) for one in (state.verdict.asked, state.verdict.allowed))
    return min(1.0, allowed / asked) if asked > 0.0 else 1.0


def _answer(robot: Robot, address: LinkAddress) -> tuple[BridgeFigures | None, State | None]:
    try:
        return figures_once(robot.id, address)
    except LinkRefused:
        return None, None


class WebCollector(Collector):
    """All web processes of this computer, for one scrape."""

    def __init__(self, host: str, authorization: str) -> None:
        self._asked_with = host, authorization

    def collect(self) -> Iterator[Metric]:
        """Yield each metric once, with the samples of this process and of others."""
        found: dict[str, Metric] = {}
        for metric in chain(_own.collect(), of_others(*self._asked_with)):
            if metric.name in found:
                found[metric.name].samples.extend(metric.samples)
            else:
                found[metric.name] = metric
        yield from found.values()


class MetricsView(ApiView):
    """`/metrics`."""

    schema = None

    @operation("metrics", "Metrics", scope=Scope.READ, parameters=[OpenApiParameter(OWN, int)])
    def get(self) -> HttpResponse:
        """In the text format of Prometheus: robots, and all web processes of this computer."""
        if not self.person.is_staff:
            raise Problem(_STAFF_ONLY)
        found = _own
        if OWN not in self.request.query_params:
            found = CollectorRegistry(auto_describe=False)
            build = Info("fleet_build", "The release of the console.", registry=found)
            build.info({"version": version(), "commit": commit()})
            found.register(RobotCollector())
            found.register(BackupCollector())
            found.register(AlertCollector())
            found.register(
                WebCollector(self.request.get_host(), self.request.headers.get("Authorization", ""))
            )
        return HttpResponse(generate_latest(found), content_type=CONTENT_TYPE_PLAIN_0_0_4)
