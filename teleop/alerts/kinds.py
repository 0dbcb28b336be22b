"""The kinds of alerts, each with the rule that holds until staff change it."""

from __future__ import annotations

from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _
from msgspec import Struct


class AlertKind(Struct, frozen=True):
    """A kind. `after_min`: a trouble that ends sooner is told to nobody."""

    label: str | Promise
    after_min: int


KINDS = {
    "robot": AlertKind(_("a robot does not answer"), 15),
    "bridge": AlertKind(_("a robot’s bridge does not answer"), 2),
    "watchdog": AlertKind(_("a robot’s watchdog is missing"), 1),
    "supervisor": AlertKind(_("the fleet supervisor is frozen or has ended"), 1),
    "redis": AlertKind(_("Redis does not answer"), 2),
    "database": AlertKind(_("the database does not answer"), 1),
    "mail": AlertKind(_("e-mails do not leave"), 10),
    "disk": AlertKind(_("a disk is nearly full"), 0),
    "store": AlertKind(_("recordings wait for the object store"), 0),
    "backup": AlertKind(_("there is no recent backup"), 0),
    "certificate": AlertKind(_("a certificate is over soon"), 0),
}
OF_ROBOTS = ("robot", "bridge", "watchdog")
AGAIN_H = 24  # between two letters about the same trouble
