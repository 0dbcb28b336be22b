"""Writing names and places of maps. Every change is checked, written and recorded in one transaction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from django.db import transaction
from msgspec import Struct

from fleet.audit.command_line import SystemAccount
from fleet.audit.services import record
from robots.places.entries import MOST_PLACES, PlaceEntry, entry_of, file_text, why_no_name
from robots.places.models import Place, SharedMap
from robots.places.selectors import Clearance, places_of
from robots.registry.configuration.profile_schema import Problems
from robots.registry.phrases import shortened
from robots.shared.sentences import joined, say
from robots.shared.wire import NotDone, Refusal

if TYPE_CHECKING:
    from fleet.accounts.models import User

    Actor = User | SystemAccount | None

_FULL = Refusal(
    "too_many", say("A map has at most {most} places: delete one first.", most=MOST_PLACES), "wire"
)


class Imported(Struct, frozen=True):
    """The result of an import; places that are not in the file stay."""

    added: int
    changed: int
    unchanged: int


@transaction.atomic
def map_name(*, digest: str, name: str, actor: Actor) -> None:
    """Name a map; an empty name removes the name. Raises `NotDone`."""
    if name and (why := why_no_name(name)):
        raise NotDone(Refusal("invalid", why, "wire"))
    found = map_hold(digest)
    if found.name != name:
        record("map.name", actor=actor, parameters={"map": digest, "from": found.name, "to": name})
        found.name = name
        found.save()


@transaction.atomic
def place_add(*, digest: str, entry: PlaceEntry, actor: Actor) -> Place:
    """Add a place. Raises `NotDone` if its name or its position is refused, or the map is full."""
    entry = _checked(entry)
    found = map_hold(digest)
    _require_free(found, entry)
    if found.places.count() >= MOST_PLACES:
        raise NotDone(_FULL)
    if refusal := Clearance(digest).refuse(entry.pose):
        raise NotDone(refusal)
    place = _made(found, entry)
    place.save(force_insert=True)
    record("place.create", actor=actor, parameters=_facts(place))
    return place


@transaction.atomic
def place_change(*, place: Place, entry: PlaceEntry, actor: Actor) -> Place:
    """Rename or move a place. Raises `NotDone`."""
    entry = _checked(entry)
    found = map_hold(place.map_id)
    if entry.key != place.key:
        _require_free(found, entry)
    before = entry_from(place)
    if entry.pose != before.pose and (refusal := Clearance(found.digest).refuse(entry.pose)):
        raise NotDone(refusal)
    if entry != before:
        _fill(place, entry)
        place.save()
        was = {"name": before.name, "x_m": before.x, "y_m": before.y, "heading_rad": before.heading}
        record("place.change", actor=actor, parameters={**_facts(place), "from": was})
    return place


@transaction.atomic
def place_delete(*, place: Place, actor: Actor) -> None:
    map_hold(place.map_id)
    record("place.delete", actor=actor, parameters=_facts(place))
    place.delete()


@transaction.atomic
def places_import(*, digest: str, entries: dict[int, PlaceEntry], actor: Actor) -> Imported:
    """Add the places of a file, by line number; an entry with the name of a stored place moves that place.

    Imports all entries; if one is wrong, raises `Problems` and imports none. A second import of the file changes
    nothing.
    """
    found = map_hold(digest)
    held = {place.key: place for place in found.places.all()}
    clearance = Clearance(digest)
    problems, added, changed = [], [], []
    for line, entry in entries.items():
        place = held.get(entry.key)
        if place is not None and entry_from(place) == entry:
            continue
        if refusal := clearance.refuse(entry.pose):
            why = refusal.sentence
            problems.append(say("line {number}, “{name}”: {why}", number=line, name=entry.name, why=why))
        elif place is None:
            added.append(_made(found, entry))
        else:
            _fill(place, entry)
            changed.append(place)
    if len(held) + len(added) > MOST_PLACES:
        count = len(held) + len(added)
        problems.append(
            say("The map would have {count} places; it may have {most}.", count=count, most=MOST_PLACES)
        )
    if problems:
        raise Problems(shortened(problems))
    Place.objects.bulk_create(added)
    Place.objects.bulk_update(changed, ["name", "x_m", "y_m", "heading_rad"])
    if added or changed:
        lists = {"added": [_pose(one) for one in added], "changed": [_pose(one) for one in changed]}
        record("place.import", actor=actor, parameters={"map": digest, **lists})
    return Imported(len(added), len(changed), len(entries) - len(added) - len(changed))


def places_export(digest: str) -> str:
    """Return the places of a map as the content of a file."""
    return file_text(map(entry_from, places_of([digest]).get(digest, [])))


def entry_from(place: Place) -> PlaceEntry:
    """Return a stored place as an entry."""
    return PlaceEntry(place.name, place.x_m, place.y_m, place.heading_rad)


def _checked(entry: PlaceEntry) -> PlaceEntry:
    try:
        return entry_of(entry.name, entry.x, entry.y, entry.heading)
    except Problems as problems:
        raise NotDone(Refusal("invalid", joined(" ", problems.lines), "wire")) from problems


def map_hold(digest: str) -> SharedMap:
    """Return the map's row; create it if it is missing. Lock the map's places until the transaction ends."""
    SharedMap.objects.get_or_create(digest=digest)
    return SharedMap.objects.select_for_update().get(pk=digest)


def _require_free(found: SharedMap, entry: PlaceEntry) -> None:
    taken = found.places.filter(key=entry.key).first()
    if taken is not None:
        raise NotDone(
            Refusal(
                "name_taken", say("This map has a place named “{name}” already.", name=taken.name), "wire"
            )
        )


def _made(found: SharedMap, entry: PlaceEntry) -> Place:
    place = Place(map=found)
    _fill(place, entry)
    return place


def _fill(place: Place, entry: PlaceEntry) -> None:
    place.name, place.key = entry.name, entry.key
    place.x_m, place.y_m, place.heading_rad = entry.pose


def _pose(place: Place) -> dict[str, Any]:
    return {"name": place.name, "x_m": place.x_m, "y_m": place.y_m, "heading_rad": place.heading_rad}


def _facts(place: Place) -> dict[str, Any]:
    return {"map": place.map_id, **_pose(place)}
