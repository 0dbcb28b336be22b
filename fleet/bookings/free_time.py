"""Search free slots: times that no rule refuses to a person, in this week and the next."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta
from functools import cache, partial
from typing import Any

from msgspec import structs

from fleet.accounts.models import User
from fleet.base.zones import zone_of
from fleet.bookings.rules import MOST_DAYS, Slot, Wish, day_of, next_opening, refusals, week_of
from fleet.bookings.selectors import WEEK, Asker, days_of, facts_of, wish_of
from robots.access.role_rows import OWN
from robots.access.selectors import lab_date
from robots.registry.models import Robot
from robots.shared.wire import Refusal

ALTERNATIVES = 3
STEP = timedelta(minutes=15)  # between the starts of proposed slots
# Refusals with these codes are the same for all later starts of the day.
FOR_THE_DAY = {"role_too_low", "holiday", "too_short", "too_long", "quota_common_week"} | {
    f"quota_{course}{period}" for course in ("", "course_") for period in ("day", "week", "open")
}


def free_on_any(
    robots: Iterable[Robot], person: User, minutes: float, *, after: datetime, now: datetime, most: int
) -> list[tuple[Robot, Slot]]:
    """Return the next slots of this length on any of these robots that no rule refuses, earliest first.

    The number of queries does not depend on the number of robots, unless a search leads to a later week.
    """
    robots, slot = list(robots), Slot(after, after + timedelta(minutes=minutes))
    if after - now > timedelta(days=MOST_DAYS):
        return []
    asker, facts = Asker(person, robots), facts_of(robots, slot)
    asked: dict[str, Any] = {"minutes": minutes, "after": after, "person": person, "now": now, "most": most}
    found: list[tuple[Robot, Slot]] = []
    for robot in robots:
        # A later start than the last of these would be left out.
        until = found[-1][1].starts_at if len(found) == most else None
        wish = wish_of(robot=robot, person=person, slot=slot, now=now, facts=facts[robot.id], asker=asker)
        more = free_slots(robot=robot, until=until, wish=wish, asker=asker, **asked)
        found = sorted([*found, *more], key=lambda one: one[1].starts_at)[:most]
    return found


def free_slots(
    *,
    robot: Robot,
    person: User,
    minutes: float,
    after: datetime,
    now: datetime,
    most: int = ALTERNATIVES,
    until: datetime | None = None,
    wish: Wish | None = None,
    asker: Asker | None = None,
    **asked: Any,
) -> list[tuple[Robot, Slot]]:
    """Return the next slots of this length that no rule refuses, earliest first.

    They begin before `until`, at most until the end of the lab's next week: the quotas of a week that is used up
    are free again then.

    `wish`: the wish for a slot that begins at `after`, if it is known. `asked`: further arguments of
    `wish_of`.
    """
    if after - now > timedelta(days=MOST_DAYS):
        return []
    length = timedelta(minutes=minutes)
    asker = asker or Asker(person, [robot])
    ask = partial(wish_of, robot=robot, person=person, now=now, asker=asker, **asked)
    known = wish or ask(slot=Slot(after, after + length))
    known_until = after + WEEK  # as far as `known.busy` is read
    until = min(until or _search_end(after), _search_end(after))
    begun = days_of(known.slot)
    facts = {begun: known}
    sources = cache(lambda day: frozenset(asker.given(robot, day)))  # of a day's roles
    found: list[tuple[Robot, Slot]] = []
    starts = _rounded_up(max(after, now))
    while starts < until and len(found) < most:
        slot = Slot(starts, starts + length)
        if slot.ends_at > known_until:
            known, known_until = ask(slot=slot), starts + WEEK
            begun = days_of(slot)
            facts[begun] = known
        in_the_way = next((one for one in known.busy if one.slot.overlaps(slot)), None)
        if in_the_way is not None:
            starts = _rounded_up(min(in_the_way.slot.ends_at, until))
            continue
        if (days := days_of(slot)) not in facts:
            same = len({sources(day) for day in (*begun, *days)}) == 1
            courses = {one.course for one in sources(days[0]) if one.course != OWN}
            # With several courses, each slot may count for another course, so its facts are read again.
            facts[days] = known if same and len(courses) <= 1 else ask(slot=slot)
        refused = refusals(structs.replace(facts[days], slot=slot, start_kept=False, taken=(), out=()))
        if not refused:
            found.append((robot, slot))
            starts = slot.ends_at
        else:
            starts = _next_start(slot, refused, known, until)
    return found


def _next_start(slot: Slot, refused: list[Refusal], wish: Wish, until: datetime) -> datetime:
    """Return the next start after a refused one that may be allowed."""
    codes = {one.code for one in refused}
    if "too_far" in codes:
        return until
    later = [slot.starts_at + STEP]
    if codes & FOR_THE_DAY:
        later.append(day_of(days_of(slot)[0], wish.lab).ends_at)
    if "closed" in codes:
        later.append(next_opening(slot.starts_at, wish.policy.opening, wish.lab) or until)
    return _rounded_up(min(max(later), until))


def _search_end(after: datetime) -> datetime:
    """Return the end of the lab's week after the one of this moment."""
    lab = zone_of("")
    return week_of(lab_date(after) + WEEK, lab).ends_at


def _rounded_up(moment: datetime) -> datetime:
    """Return the next quarter of an hour."""
    over = timedelta(minutes=moment.minute % 15, seconds=moment.second, microseconds=moment.microsecond)
    return moment if not over else moment - over + STEP
