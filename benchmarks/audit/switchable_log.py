"""Settings of a console whose bridges write no records while a file exists, to measure the cost of records.

Only a bridge's own records are left out; the rest is unchanged.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from django.apps import AppConfig

from fleet.settings import *  # noqa: F403
from fleet.settings import INSTALLED_APPS

INSTALLED_APPS = [*INSTALLED_APPS, "benchmarks.audit.switchable_log.Switched"]


class Switched(AppConfig):
    """Installs the switch."""

    name = "benchmarks.audit"
    label = "benchmarks"  # fleet.audit has the label audit

    def ready(self) -> None:
        """Wrap the sink's methods before a bridge creates a sink."""
        from robots.records.bridge_records import AuditSink

        off = Path(os.environ["FLEET_BENCH_UNRECORDED"])
        for name in ("test_writable", "begin_drive", "end_drive", "begin_gate", "end_gate"):
            setattr(AuditSink, name, _unless(off, getattr(AuditSink, name)))


def _unless(off: Path, method: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(method)
    def call(*args: Any) -> Any:
        return 0 if off.exists() else method(*args)

    return call
