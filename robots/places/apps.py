"""Places as a Django app."""

from django.apps import AppConfig
from django.utils.translation import gettext_lazy as _


class PlacesConfig(AppConfig):
    """Maps that robots share, and their named places."""

    name = "robots.places"
    label = "places"
    verbose_name = _("Places")
