"""``python -m benchmarks.soak.log_side``: print the audit log of this environment as one `Log`."""

from __future__ import annotations

import os
import sys

import django
import msgspec

from benchmarks.soak.reconciliation import Entry, Log


def main() -> None:
    """Print the log."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    django.setup()
    from fleet.audit.integrity.verify import verify_all
    from fleet.audit.models import Record  # models cannot be imported before the apps are ready

    entries = [
        Entry(found.pk, found.at.timestamp(), found.kind, found.of_id, found.outcome, found.details)
        for found in Record.objects.select_related("content").order_by("pk")
    ]
    findings = [str(finding) for finding in verify_all().findings]
    sys.stdout.buffer.write(msgspec.json.encode(Log(entries, findings)))


if __name__ == "__main__":
    main()
