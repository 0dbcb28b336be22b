"""Maps that people named or gave places, and the places.

A map is its content: the digest of `RobotMap`. A robot that maps the building again has another map, without places:
the new map may have another origin, and a place would be somewhere else. People carry places over by a file.
"""

from __future__ import annotations

from django.db import models
from django.utils.translation import gettext_lazy as _

from robots.places.entries import LONGEST_NAME


class SharedMap(models.Model):
    """A map by its content. It is written when it first gets a name or a place."""

    digest = models.CharField(max_length=64, primary_key=True)  # as in `RobotMap`
    name = models.CharField(_("name"), max_length=LONGEST_NAME, blank=True)

    class Meta:
        verbose_name = _("map")
        verbose_name_plural = _("maps")

    def __str__(self) -> str:
        return self.name or self.digest[:8]


class Place(models.Model):
    """A place of a map to which robots can be sent, with a heading. Frame of the map."""

    map = models.ForeignKey(SharedMap, on_delete=models.CASCADE, related_name="places")
    name = models.CharField(_("name"), max_length=LONGEST_NAME)
    key = models.CharField(max_length=2 * LONGEST_NAME)  # of the name: Kitchen and kitchen are one name
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
