"""Whether a lesson may call people to its robot."""

from __future__ import annotations

from datetime import datetime, timedelta

from django.utils.translation import gettext as _

from fleet.bookings.models import Booking
from fleet.bookings.selectors import out_between
from robots.records.faults import is_offline


def why_nobody_is_called(booking: Booking, now: datetime) -> str:
    """Return why nobody can drive the robot of a lesson that runs, in the reader's language; empty: they can."""
    if booking.starts_at > now:
        return ""  # robots are off before a lesson
    if out := out_between(booking.robot, now, now + timedelta(seconds=1)):
        return _("Out of service (%(why)s): nobody is called until it is back.") % {"why": out[0].label}
    if is_offline(booking.robot_id):
        return _("The robot is offline: nobody is called until it is back.")
    return ""
