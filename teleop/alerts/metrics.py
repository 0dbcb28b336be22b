"""Open alerts as metrics, for Prometheus."""

from __future__ import annotations

from collections.abc import Iterator

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from teleop.alerts.kinds import KINDS
from teleop.models import Alert


class AlertCollector(Collector):
    """One sample for each open alert that the rules have told, and a zero for each kind without one."""

    def collect(self) -> Iterator[Metric]:
        """Yield the open alerts."""
        metric = GaugeMetricFamily("fleet_alert", "1: it needs somebody now.", labels=["kind", "subject"])
        open_ones = list(
            Alert.objects.filter(over_at=None, told_at__isnull=False).values_list("kind", "subject")
        )
        for kind, subject in open_ones:
            metric.add_metric([kind, subject], 1.0)
        for kind in KINDS.keys() - {kind for kind, _ in open_ones}:
            metric.add_metric([kind, ""], 0.0)
        yield metric
