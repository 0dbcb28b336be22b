"""The rule of each kind of alert: the stored one, or the one of its kind."""

from __future__ import annotations

from django.db.models import Count

from fleet.accounts.models import User
from fleet.audit.services import record
from teleop.alerts.kinds import AGAIN_H, KINDS
from teleop.models import Alert, AlertRule


def rules() -> dict[str, AlertRule]:
    """Return the rule of each kind."""
    stored = {one.kind: one for one in AlertRule.objects.all()}
    return {
        name: stored.get(name) or AlertRule(kind=name, after_min=kind.after_min, again_h=AGAIN_H)
        for name, kind in KINDS.items()
    }


def open_alerts() -> dict[str, int]:
    """Return the number of open alerts of each kind that the rules have told. One query."""
    found = Alert.objects.filter(over_at=None, told_at__isnull=False).order_by().values_list("kind")
    return dict(found.annotate(number=Count("pk")))


def rule_save(rule: AlertRule, actor: User) -> None:
    """Store a rule. Recorded."""
    rule.save()
    facts = {"kind": rule.kind, "active": rule.active, "after_min": rule.after_min, "again_h": rule.again_h}
    record("alert.rule", actor=actor, parameters=facts)
