"""Recordings as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class RecordingsConfig(AppConfig):
    """The rows of recordings; the files are on the computer of the robot's bridge, or in a store."""

    name = "robots.recordings"
    label = "recordings"
    verbose_name = _("Recordings")
