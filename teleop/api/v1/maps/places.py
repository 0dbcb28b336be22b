"""Named places of a map: everybody who sees a robot with this map reads them; its supervisors and staff change them."""

from __future__ import annotations

from typing import Annotated

from django.db import transaction
from django.http import HttpResponse
from django.shortcuts import get_object_or_404
from msgspec import UNSET, Meta, Struct, UnsetType, structs
from rest_framework.response import Response

from robots.places import entries, selectors, services
from robots.places.entries import LARGEST_FILE, LONGEST_NAME, PlaceEntry
from robots.places.models import Place
from robots.places.services import Imported
from robots.registry.configuration.profile_schema import Problems
from robots.shared.sentences import joined
from robots.shared.wire import Refusal
from robots.shared.wire.navigation import Coordinate, Heading
from teleop.api.v1.framework.operation import reads
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.maps.maps import MapsBase, PlaceDetail, detail_of
from teleop.api.v1.setup.base import edits, locked, makes, manages

Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]


class PlaceRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new place: metres and radians in the frame of the map."""

    name: Name
    x: Coordinate
    y: Coordinate
    heading: Heading = 0.0


class PlaceChange(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Fields that are left out stay as they are."""

    name: Name | UnsetType = UNSET
    x: Coordinate | UnsetType = UNSET
    y: Coordinate | UnsetType = UNSET
    heading: Heading | UnsetType = UNSET


class PlaceList(Struct, frozen=True):
    """Places, by name."""

    places: list[PlaceDetail]


class PlacesFile(Struct, frozen=True, forbid_unknown_fields=True):
    """A file of places, as `GET …/places/export` writes it: CSV with the columns name, x, y, heading."""

    csv: Annotated[str, Meta(max_length=LARGEST_FILE)]


class PlacesBase(MapsBase):
    """Base of the views of places."""

    def place(self, digest: str, number: int) -> Place:
        """Return a place of a map that the person sees. Raises `Problem` or `Http404`."""
        return get_object_or_404(Place, map=self.seen_map(digest).digest, pk=number)


class PlacesView(PlacesBase):
    @reads("places_list", "List the places of a map")
    def get(self, digest: str) -> PlaceList:
        """By name."""
        found = self.seen_map(digest).digest
        return PlaceList([detail_of(place) for place in selectors.places_of([found]).get(found, [])])

    @makes("places_add", "Add a place", answer=PlaceDetail, keyed=True, refuses=(404, 409))
    def post(self, digest: str, body: PlaceRequest) -> Response:
        """For staff and supervisors of a robot that has the map. Refused where no robot of this map has room."""
        found = self.changeable_map(digest).digest
        entry = PlaceEntry(body.name, body.x, body.y, body.heading)
        place = services.place_add(digest=found, entry=entry, actor=self.person)
        return self.tagged(detail_of(place), 201, f"/api/v1/maps/{found}/places/{place.pk}")


class PlaceView(PlacesBase):
    @reads("places_read", "Read a place", answer=PlaceDetail)
    def get(self, digest: str, number: int) -> Response:
        """With the ETag that a change needs."""
        return self.tagged(detail_of(self.place(digest, number)))

    @edits("places_change", "Rename or move a place", answer=PlaceDetail)
    def patch(self, digest: str, number: int, body: PlaceChange) -> Response:
        """For staff and supervisors of a robot that has the map."""
        self.changeable_map(digest)
        with transaction.atomic():
            services.map_hold(digest)  # locked first, as in every change of places
            place = locked(self.place(digest, number))
            self.require_unchanged(detail_of(place))
            asked = {name: value for name, value in structs.asdict(body).items() if value is not UNSET}
            entry = structs.replace(services.entry_from(place), **asked)
            services.place_change(place=place, entry=entry, actor=self.person)
        return self.tagged(detail_of(place))

    @manages("places_delete", "Delete a place")
    def delete(self, digest: str, number: int) -> None:
        """For staff and supervisors of a robot that has the map. A robot on its way there drives on."""
        self.changeable_map(digest)
        services.place_delete(place=self.place(digest, number), actor=self.person)


class ExportView(PlacesBase):
    @reads("places_export", "Write the places of a map to a file", content_type="text/csv")
    def get(self, digest: str) -> HttpResponse:
        """CSV in UTF-8: name, x, y (metres), heading (radians)."""
        found = self.seen_map(digest).digest
        answer = HttpResponse(services.places_export(found), content_type="text/csv; charset=utf-8")
        answer["Content-Disposition"] = f'attachment; filename="places-{found[:8]}.csv"'
        return answer


class ImportView(PlacesBase):
    @manages("places_import", "Add the places of a file to a map", refuses=(404, 409))
    def post(self, digest: str, body: PlacesFile) -> Imported:
        """For staff and supervisors of a robot that has the map. A place with the name of another one moves it; places
        that are not in the file stay. All lines or none: the problem names the wrong ones. The same file again changes
        nothing."""
        found = self.changeable_map(digest).digest
        try:
            return services.places_import(digest=found, entries=entries.read(body.csv), actor=self.person)
        except Problems as problems:
            refusals = [Refusal("invalid", line, "wire") for line in problems.lines]
            whole = Refusal("invalid", joined(" ", problems.lines), "wire")
            raise Problem(whole, others=refusals) from problems
