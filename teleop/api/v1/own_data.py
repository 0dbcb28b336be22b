"""A person's own data, as on the page *Your data*."""

from __future__ import annotations

from collections.abc import Iterable

from django.http import HttpResponseBase

from robots.registry.models import Robot
from teleop.api.v1.framework.operation import ApiView, reads
from teleop.reports.own_data import export_of


class OwnDataView(ApiView):
    tag = "records"

    def concerned(self, **_asked: object) -> Iterable[Robot]:
        return ()  # the data of all robots: no token that is bound to some

    @reads("own_data_export", "Export your own data", content_type="application/jsonl", refuses=())
    def post(self) -> HttpResponseBase:
        """Your records, and those of others about you, as on the page Your data: one JSON object a line. The export is
        itself recorded."""
        return export_of(self.person)
