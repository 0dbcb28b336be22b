"""Open alerts as metrics, for Prometheus."""

from __future__ import annotations

import time
from collections.abc import Iterator

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from teleop.alerts.kinds import KINDS
from teleop.alerts.watch import knows, look_age_s
from teleop.models import Alert


class AlertCollector(Collector):
    """One sample for each open alert that the rules have told, and a zero for each kind without one.

    None while it is not known: this process has not looked lately.
    """

    def collect(self) -> Iterator[Metric]:
        """Yield the open alerts."""
        looked = GaugeMetricFamily(
            "fleet_alerts_last_look_timestamp_seconds",
            "When this web process looked for what needs somebody.",
        )
        if (age_s := look_age_s()) is not None:
            looked.add_metric([], time.time() - age_s)
        yield looked
        if not knows():
            return
        metric = GaugeMetricFamily("fleet_alert", "1: it needs somebody now.", labels=["kind", "subject"])
        open_ones = list(
            Alert.objects.filter(over_at=None, told_at__isnull=False).values_list("kind", "subject")
        )
        for kind, subject in open_ones:
            metric.add_metric([kind, subject], 1.0)
        for kind in KINDS.keys() - {kind for kind, _ in open_ones}:
            metric.add_metric([kind, ""], 0.0)
        yield metric
