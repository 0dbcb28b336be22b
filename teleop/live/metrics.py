"""Metrics of the web process: forwarded drive messages, links and viewers."""

from __future__ import annotations

import os
from collections.abc import Iterator

from prometheus_client import CollectorRegistry
from prometheus_client.core import GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.exposition import generate_latest
from prometheus_client.registry import Collector

from robots.link.client import links
from robots.shared.processes.durations import buckets
from teleop.live import robot_hub

WEB = "web"  # the label with the process id of the web process


class DrivingCollector(Collector):
    """The metrics of this process."""

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics. Must not wait: this runs on the event loop that forwards drive input."""
        web, hubs = str(os.getpid()), robot_hub.open_hubs()
        names = [WEB, "robot"]
        forward = HistogramMetricFamily(
            "fleet_command_forward_seconds", "Drive messages, from arrival until sent on.", labels=names
        )
        for robot, taken in robot_hub.forward_durations.items():
            forward.add_metric([web, robot], buckets(taken.counts), taken.sum_s)
        link = GaugeMetricFamily("fleet_link_up", "1: the link to the robot's bridge is up.", labels=names)
        viewers = GaugeMetricFamily("fleet_viewers", "Pages that get views of the robot.", labels=names)
        pages = GaugeMetricFamily("fleet_connections", "WebSockets about the robot.", labels=names)
        for hub in hubs:
            labels = [web, hub.entry.facts.slug]
            link.add_metric(labels, float(hub.link.up))
            viewers.add_metric(labels, float(sum(one.wants_views for one in hub.members.values())))
            pages.add_metric(labels, float(len(hub.members)))
        open_links = GaugeMetricFamily("fleet_links_open", "Links of this process to bridges.", labels=[WEB])
        open_links.add_metric([web], float(len(links.all())))
        yield from (forward, link, viewers, pages, open_links)


_registry = CollectorRegistry()
_registry.register(DrivingCollector())


def own_metrics() -> bytes:
    """Return the metrics in the text format of Prometheus."""
    return generate_latest(_registry)
