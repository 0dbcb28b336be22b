"""Maps with a name or places, and the places.

A map is identified by its content: the digest of `RobotMap`. If a robot maps the building again, the result is another
map, without places: the new map may have another origin, and then an old place would be at a wrong position. People can
copy places to the new map by a file.
"""

from __future__ import annotations

from django.db import models
from django.utils.translation import gettext_lazy as _

from robots.places.entries import LONGEST_NAME


class SharedMap(models.Model):
    """A map, identified by its content. The row is created when the map gets its first name or place."""

    digest = models.CharField(max_length=64, primary_key=True)  # as in `RobotMap`
    name = models.CharField(_("name"), max_length=LONGEST_NAME, blank=True)

    class Meta:
        verbose_name = _("map")
        verbose_name_plural = _("maps")

    def __str__(self) -> str:
        return self.name or self.digest[:8]


class Place(models.Model):
    """A place of a map, with a heading, to which robots can be sent. Coordinates are in the frame of the map."""

    map = models.ForeignKey(SharedMap, on_delete=models.CASCADE, related_name="places")
    name = models.CharField(_("name"), max_length=LONGEST_NAME)
    key = models.CharField(max_length=2 * LONGEST_NAME)  # `key_of` the name: Kitchen and kitchen are the same
    x_m = models.FloatField()
    y_m = models.FloatField()
    heading_rad = models.FloatField()

    class Meta:
        ordering = ["key"]
        verbose_name = _("place")
        verbose_name_plural = _("places")
        constraints = [models.UniqueConstraint(fields=["map", "key"], name="one_place_per_map_and_name")]

    def __str__(self) -> str:
        return self.name
