"""Metrics of the last backup, for Prometheus."""

from __future__ import annotations

from collections.abc import Iterator

from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from fleet.backup.selectors import last_backup


class BackupCollector(Collector):
    """The last backup and the last check, from the log. Without one, there is no sample."""

    def collect(self) -> Iterator[Metric]:
        """Yield when they were, in seconds since 1970."""
        last = last_backup()
        for name, words, at in (
            ("fleet_last_backup_timestamp_seconds", "When the last backup was made.", last.at),
            (
                "fleet_last_backup_check_timestamp_seconds",
                "When a backup was last found intact.",
                last.checked_at,
            ),
        ):
            metric = GaugeMetricFamily(name, words)
            if at is not None:
                metric.add_metric([], at.timestamp())
            yield metric
