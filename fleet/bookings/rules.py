"""The rules of booking, as pure functions: they use no clock and no database. `RULES` lists them.

A rule returns None if it allows the wish, else a refusal with the rule, its limit and the remedy. The
refusals of all rules are reported together. Days, weeks and opening hours are those of the lab's time zone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime, time, timedelta
from functools import partial
from zoneinfo import ZoneInfo

from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.base import zones
from fleet.base.formats.dates import dated
from fleet.bookings.models import WEEKDAYS, Holiday, Policy
from robots.access.models import Course
from robots.registry.models import Role
from robots.shared.sentences import Sentence, counted, joined, say
from robots.shared.wire import Refusal

FAR = datetime.max.replace(tzinfo=UTC)  # stands for "no end"
# No policy allows a longer slot. So queries for slots that still run look back only this far.
LONGEST = timedelta(days=7)
INSTANT = timedelta(microseconds=1)
MOST_DAYS = 3650  # a booking farther ahead than this is a typing error

Hours = Mapping[str, Sequence[Sequence[str]]]  # `Policy.opening`


class Slot(Struct, frozen=True):
    """A half-open interval in UTC."""

    starts_at: datetime
    ends_at: datetime

    @property
    def minutes(self) -> float:
        """Return the length in minutes."""
        return (self.ends_at - self.starts_at).total_seconds() / 60.0

    def overlaps(self, other: Slot) -> bool:
        """Return whether both have a moment in common."""
        return self.starts_at < other.ends_at and other.starts_at < self.ends_at

    def shared_minutes(self, other: Slot) -> float:
        """Return the length of the common part in minutes."""
        starts, ends = max(self.starts_at, other.starts_at), min(self.ends_at, other.ends_at)
        return max(0.0, (ends - starts).total_seconds() / 60.0)

    def within(self, other: Slot) -> bool:
        """Return whether this slot lies completely inside the other."""
        return other.starts_at <= self.starts_at and self.ends_at <= other.ends_at


class Taken(Struct, frozen=True):
    """Time that is not free: a booking, or a time when the robot is out of service."""

    slot: Slot
    label: str  # the name of the person or robot of a booking, or the reason why the robot is out of service
    own: bool = False  # a booking of the person who wants the slot


class Quota(Struct, frozen=True):
    """The quotas of a course, and the bookings that count."""

    course: str  # name
    day_min: int | None = None
    week_min: int | None = None
    at_once: int | None = None
    course_week_min: int | None = None  # for all its people together
    own: tuple[Slot, ...] = ()  # the person's bookings in the course
    all: tuple[Slot, ...] = ()  # the bookings of all its people


class Wish(Struct, frozen=True):
    """A slot that a person wants, and the facts that the rules check."""

    robot: str  # name
    slot: Slot
    now: datetime
    policy: Policy
    lab: ZoneInfo
    zone: ZoneInfo  # of the person who reads the refusals
    start_kept: bool = False  # a booking is changed and keeps its start, which was checked when it was booked
    role: Role | None = None  # from the slot's start to its end
    role_until: date | None = None  # the last day on which a course lets the person drive the robot
    missing: tuple[str, ...] = ()  # qualifications that the person lacks at the start
    qualified_until: datetime | None = None  # when the first required qualification expires
    own: tuple[Slot, ...] = ()  # the person's other bookings, of every robot, but no lessons
    own_here: tuple[Slot, ...] = ()  # the person's other bookings of this robot, also lessons
    other_robots: tuple[
        Taken, ...
    ] = ()  # the person's bookings of other robots, with robot names, without lessons
    lesson: bool = False  # a lesson of a course: a teacher may book several robots at once
    course: Course | None = None  # the slot counts for this course, which lets the person drive the robot
    quota: Quota = Quota("")  # of that course
    wrong_course: str = ""  # the name of the chosen course, if it does not let the person drive the robot
    taken: tuple[Taken, ...] = ()  # bookings of the robot that overlap
    out: tuple[Taken, ...] = ()  # out-of-service periods that overlap
    holidays: tuple[Holiday, ...] = ()  # of the lab, not over at the slot's start
    busy: tuple[Taken, ...] = ()  # bookings and out-of-service periods in the week from the slot's start on

    def local(self, moment: datetime) -> datetime:
        """Return a moment in the reader's zone."""
        return moment.astimezone(self.zone)


Rule = Callable[[Wish], Refusal | None]


def shown(moment: datetime, zone: ZoneInfo) -> str:
    """Return a moment as text for people: weekday, date, time."""
    return dated(moment.astimezone(zone), "D d M Y, H:i")


def from_to(slot: Slot, zone: ZoneInfo) -> str:
    """Return begin and end of a slot as text; the end with its day if that is another day."""
    same = zones.day_of(slot.starts_at, zone) == zones.day_of(slot.ends_at, zone)
    ends = dated(slot.ends_at.astimezone(zone), "H:i") if same else shown(slot.ends_at, zone)
    return _("%(from)s to %(to)s") % {"from": shown(slot.starts_at, zone), "to": ends}


def duration(minutes: float) -> Sentence:
    """Return a length of time as text for people."""
    whole = round(minutes)
    if whole % 1440 == 0 and whole:
        return counted("{count} day", "{count} days", count=whole // 1440)
    hours, rest = divmod(whole, 60)
    if not hours:
        return say("{minutes} min", minutes=rest)
    return (
        say("{hours} h {minutes} min", hours=hours, minutes=rest) if rest else say("{hours} h", hours=hours)
    )


def _no(code: str, text: str, **figures: float | int | str | None) -> Refusal:
    return Refusal(code, text, "booking", figures)


def _not_by(policy: Policy, code: str, text: str, **figures: float | int | str | None) -> Refusal:
    """Return a refusal by a policy. The text names the policy, so that people know whom to ask."""
    told = say("{refusal} (Policy of {policy}.)", refusal=text, policy=policy.of)
    return _no(code, told, **figures, policy=policy.of)


# --- the slot itself ------------------------------------------------------------------------------


def in_order(wish: Wish) -> Refusal | None:
    """Check that the end comes after the start."""
    if wish.slot.ends_at > wish.slot.starts_at:
        return None
    if wish.slot.ends_at == wish.slot.starts_at:
        return _no("zero_length", "The slot has no length: choose an end after the start.")
    return _no("backwards", "The slot ends before it begins: exchange the two times.")


def not_in_past(wish: Wish) -> Refusal | None:
    """Check that a slot begins in this minute or later.

    If its start is kept, check that it ends in the future.
    """
    if wish.start_kept and wish.slot.ends_at > wish.now:
        return None
    if wish.start_kept:
        key = "The slot ends in the past: it is {now:when} now. Choose a later end, or finish it."
        return _no("in_past", say(key, now=wish.local(wish.now)))
    if wish.slot.starts_at > wish.now - timedelta(minutes=1):
        return None
    key = "The slot begins in the past: it is {now:when} now. Choose a later start."
    return _no("in_past", say(key, now=wish.local(wish.now)))


def has_role(wish: Wish) -> Refusal | None:
    """Check that the person may drive the robot."""
    if wish.role is not None and wish.role >= Role.OPERATOR:
        return None
    if wish.role_until is None:
        key = "You may not drive {robot} during this time: ask the staff, or your course’s supervisor."
        return Refusal("role_too_low", say(key, robot=wish.robot), "account")
    text = say(
        "You may drive {robot} until {day:day}. Choose an earlier time, or ask the staff, or your course’s supervisor.",
        robot=wish.robot,
        day=wish.role_until,
    )
    return Refusal("role_too_low", text, "account", {"until": wish.role_until.isoformat()})


def qualified(wish: Wish) -> Refusal | None:
    """Check that the person has the qualifications that the robot demands, until the end of the slot."""
    until = wish.qualified_until
    if not wish.missing and (until is None or wish.slot.ends_at <= until):
        return None
    if until is not None and not wish.missing:
        text = say(
            "A qualification that {robot} demands ends {until:when}. End the slot by then, or ask the staff or your "
            "course’s supervisor to renew it.",
            robot=wish.robot,
            until=wish.local(until),
        )
        return Refusal("unqualified", text, "account", {"until": until.isoformat()})
    names = ", ".join(wish.missing)
    text = say(
        "{robot} demands {names}. Ask the staff or your course’s supervisor for it.",
        robot=wish.robot,
        names=names,
    )
    return Refusal("unqualified", text, "account", {"missing": names})


def by_a_course(wish: Wish) -> Refusal | None:
    """Check that the chosen course lets the person drive the robot."""
    if not wish.wrong_course:
        return None
    key = "{course} does not let you drive {robot} at this time: choose another course."
    text = say(key, course=wish.wrong_course, robot=wish.robot)
    return Refusal("wrong_course", text, "account")


def ends_some_day(wish: Wish) -> Refusal | None:
    """Check that the slot is not longer than `LONGEST`. Staff cannot override this rule."""
    if wish.slot.ends_at - wish.slot.starts_at <= LONGEST:
        return None
    return _no(
        "too_long",
        say("A slot lasts at most {days} days: book several.", days=LONGEST.days),
        longest_min=LONGEST.days * 1440,
    )


# --- the robot ------------------------------------------------------------------------------------


def is_free(wish: Wish) -> Refusal | None:
    """Check that no other booking of the robot overlaps.

    Bookings that are over are left out: another rule refuses a past slot, and the text would name their people.
    """
    taken = [one for one in wish.taken if one.slot.ends_at > wish.now]
    if not taken:
        return None
    first = taken[0]
    until = max(one.slot.ends_at for one in taken)
    times = {"start": wish.local(first.slot.starts_at), "end": wish.local(first.slot.ends_at)}
    if first.own:
        text = say(
            "You have booked {robot} from {start:when} to {end:when} already: change that booking, or choose another "
            "time.",
            robot=wish.robot,
            **times,
        )
        return _no("taken", text, until=until.isoformat())
    text = say(
        "{person} has booked {robot} from {start:when}. It is free again at {end:when}: choose another time, or join "
        "the waiting list.",
        person=first.label,
        robot=wish.robot,
        start=times["start"],
        end=wish.local(until),
    )
    return _no("taken", text, until=until.isoformat())


def in_service(wish: Wish) -> Refusal | None:
    """Check that the robot is in service during the whole slot."""
    if not wish.out:
        return None
    period = wish.out[0]
    end = period.slot.ends_at
    known = end != FAR
    until = say("until {time:when}", time=wish.local(end)) if known else say("until further notice")
    key = "{robot} is out of service {until} ({why}). Choose another robot or a later time."
    text = say(key, robot=wish.robot, until=until, why=period.label)
    return _no("out_of_service", text, until=end.isoformat() if known else None)


# --- the policy -----------------------------------------------------------------------------------


def in_opening_hours(wish: Wish) -> Refusal | None:
    """Check that the slot lies within the opening hours."""
    hours: Hours = wish.policy.opening
    if not hours:
        return None
    moment = wish.slot.starts_at
    while moment < wish.slot.ends_at:
        intervals = opening_of(moment.astimezone(wish.lab).date(), hours, wish.lab)
        opening = next((one for one in intervals if one.starts_at <= moment < one.ends_at), None)
        if opening is None:
            key = "{robot} can be booked {hours} ({zone}). Move the slot into these hours."
            text = say(key, robot=wish.robot, hours=_in_words(hours), zone=wish.lab.key)
            return _not_by(wish.policy, "closed", text)
        moment = opening.ends_at
    return None


def not_on_holiday(wish: Wish) -> Refusal | None:
    """Check that the slot is on no holiday of the lab."""
    days = list(_dates(wish.slot, wish.lab)) if wish.holidays else []
    for one in wish.holidays:
        if not any(one.first_day <= day <= one.last_day for day in days):
            continue
        first, last = one.first_day, one.last_day
        when = say("{day:day}", day=first)
        if first != last:
            when = say("{first:day} to {last:day}", first=first, last=last)
        text = say("The lab is closed: {name}, {when}. Choose another day.", name=one.name, when=when)
        figures = {"first_day": first.isoformat(), "last_day": last.isoformat()}
        return Refusal("holiday", text, "booking", figures)
    return None


def closed(wish: Wish) -> Refusal | None:
    """Check opening hours and holidays."""
    return in_opening_hours(wish) or not_on_holiday(wish)


def opening_of(day: date, hours: Hours, lab: ZoneInfo) -> list[Slot]:
    """Return the opening intervals of one day, in order. An end of 24:00 is the next midnight."""
    midnight = day_of(day, lab).ends_at
    return [
        Slot(_at(day, opens, lab), midnight if closes == "24:00" else _at(day, closes, lab))
        for opens, closes in hours.get(WEEKDAYS[day.weekday()], ())
    ]


def next_opening(after: datetime, hours: Hours, lab: ZoneInfo) -> datetime | None:
    """Return when an opening interval begins after a moment, within eight days."""
    today = after.astimezone(lab).date()
    for number in range(8):
        for opening in opening_of(today + timedelta(days=number), hours, lab):
            if opening.starts_at > after:
                return opening.starts_at
    return None


def _at(day: date, clock: str, lab: ZoneInfo) -> datetime:
    return datetime.combine(day, time.fromisoformat(clock), tzinfo=lab).astimezone(UTC)


_DAYS = dict(
    zip(
        WEEKDAYS,
        (say("Mon"), say("Tue"), say("Wed"), say("Thu"), say("Fri"), say("Sat"), say("Sun")),
        strict=True,
    )
)


def _in_words(hours: Hours) -> Sentence:
    """Return the opening hours as text, with equal days in a row joined: "Mon-Fri 08:00-12:00, 13:00-20:00"."""
    spans: list[tuple[str, str, str]] = []
    for day in WEEKDAYS:
        if day not in hours:
            continue
        times = ", ".join(f"{opens}-{closes}" for opens, closes in hours[day])
        follows = spans and WEEKDAYS.index(spans[-1][1]) + 1 == WEEKDAYS.index(day) and spans[-1][2] == times
        if follows:
            spans[-1] = (spans[-1][0], day, times)
        else:
            spans.append((day, day, times))
    return joined(
        "; ",
        [
            say("{day} {times}", day=_DAYS[first], times=times)
            if first == last
            else say("{first}-{last} {times}", first=_DAYS[first], last=_DAYS[last], times=times)
            for first, last, times in spans
        ],
    )


def long_enough(wish: Wish) -> Refusal | None:
    """Check that the slot is not shorter than the policy allows."""
    least = wish.policy.shortest_min
    if wish.slot.minutes >= least:
        return None
    text = say("A slot lasts at least {least}: make it longer.", least=duration(least))
    return _not_by(wish.policy, "too_short", text, shortest_min=least)


def short_enough(wish: Wish) -> Refusal | None:
    """Check that the slot is not longer than the policy allows."""
    most = wish.policy.longest_min
    if wish.slot.minutes <= most or wish.slot.ends_at - wish.slot.starts_at > LONGEST:
        return None
    key = "A slot lasts at most {most}, yours {asked}: make it shorter."
    text = say(key, most=duration(most), asked=duration(wish.slot.minutes))
    return _not_by(wish.policy, "too_long", text, longest_min=most)


def within_horizon(wish: Wish) -> Refusal | None:
    """Check that the slot is not farther ahead than the policy allows."""
    last = wish.now + timedelta(days=wish.policy.horizon_days)
    if wish.slot.starts_at <= last:
        return None
    text = say(
        "{robot} can be booked {days} days ahead, until {last:when}. Choose an earlier time.",
        robot=wish.robot,
        days=wish.policy.horizon_days,
        last=wish.local(last),
    )
    return _not_by(wish.policy, "too_far", text, horizon_days=wish.policy.horizon_days)


def with_notice(wish: Wish) -> Refusal | None:
    """Check that the slot begins after the notice that the policy demands."""
    notice = wish.policy.notice_min
    first = wish.now + timedelta(minutes=notice)
    if not notice or wish.start_kept or wish.slot.starts_at >= first:
        return None
    key = "Book {robot} at least {notice} before the start: choose {first:when} or later."
    text = say(key, robot=wish.robot, notice=duration(notice), first=wish.local(first))
    return _not_by(wish.policy, "short_notice", text, notice_min=notice)


def within_day_quota(wish: Wish) -> Refusal | None:
    """Check that the person's minutes of each day stay within the policy's quota."""
    return _quota(wish, wish.policy.day_min, wish.own, _days(wish), _DAY, say("You may"))


def within_week_quota(wish: Wish) -> Refusal | None:
    """Check that the person's minutes of each week stay within the policy's quota."""
    return _quota(wish, wish.policy.week_min, wish.own, _weeks(wish), _WEEK, say("You may"))


def within_course_day_quota(wish: Wish) -> Refusal | None:
    """Check that the person's minutes of each day stay within the course's quota."""
    quota = wish.quota
    return _quota(wish, quota.day_min, quota.own, _days(wish), _DAY, _in_course(quota), "course_")


def within_course_week_quota(wish: Wish) -> Refusal | None:
    """Check that the person's minutes of each week stay within the course's quota."""
    quota = wish.quota
    return _quota(wish, quota.week_min, quota.own, _weeks(wish), _WEEK, _in_course(quota), "course_")


def within_common_quota(wish: Wish) -> Refusal | None:
    """Check that the minutes of all people of the course stay within its quota of each week."""
    quota = wish.quota
    subject = say("All of {course} together may", course=quota.course)
    return _quota(wish, quota.course_week_min, quota.all, _weeks(wish), _WEEK, subject, "common_")


_DAY, _WEEK = say("day"), say("week")


def _in_course(quota: Quota) -> Sentence:
    return say("In {course} you may", course=quota.course)


def _quota(
    wish: Wish,
    most: int | None,
    own: Sequence[Slot],
    periods: Sequence[Slot],
    name: Sentence,
    subject: Sentence,
    code: str = "",
) -> Refusal | None:
    if most is None or wish.lesson:
        return None
    for period in periods:
        used = sum(period.shared_minutes(slot) for slot in own)
        if used + period.shared_minutes(wish.slot) > most:
            left = max(0.0, most - used)
            text = say(
                "{subject} book {most} per {period}; {left} are left before {end:when}. Cancel another booking, or "
                "choose a later {period}.",
                subject=subject,
                most=duration(most),
                period=name,
                left=duration(left),
                end=wish.local(period.ends_at),
            )
            refuse = _no if code else partial(_not_by, wish.policy)
            return refuse(f"quota_{code}{name}", text, most_min=most, left_min=round(left))
    return None


def within_count(wish: Wish) -> Refusal | None:
    """Check that the person does not have too many future bookings."""
    return _count(wish, wish.policy.at_once, wish.own, say("You may"), "open", partial(_not_by, wish.policy))


def within_course_count(wish: Wish) -> Refusal | None:
    """Check that the person does not have too many future bookings in the course."""
    quota = wish.quota
    return _count(wish, quota.at_once, quota.own, _in_course(quota), "course_open", _no)


def _count(
    wish: Wish,
    most: int | None,
    own: Sequence[Slot],
    subject: Sentence,
    code: str,
    refuse: Callable[..., Refusal],
) -> Refusal | None:
    to_come = sum(1 for slot in own if slot.ends_at > wish.now)
    if most is None or wish.lesson or to_come < most:
        return None
    text = counted(
        "{subject} have {count} booking to come. You already have {have}. Cancel one, or book again after the next.",
        "{subject} have {count} bookings to come. You already have {have}. Cancel one, or book again after the next.",
        count=most,
        subject=subject,
        have=to_come,
    )
    return refuse(f"quota_{code}", text, most=most, have=to_come)


def within_robots_at_once(wish: Wish) -> Refusal | None:
    """Check that the person has not booked too many other robots for the same time. Lessons do not count."""
    most = wish.policy.robots_at_once
    others = [one for one in wish.other_robots if one.slot.overlaps(wish.slot)]
    moments = [max(one.slot.starts_at, wish.slot.starts_at) for one in others]
    at_once = max((_robots_at(moment, others) for moment in moments), default=0)
    if wish.lesson or at_once < most:
        return None
    first = others[0]
    text = say(
        "You may book {robots} for the same time. You have already booked {robot} from {start:when} to {end:when}. "
        "Cancel that booking, or choose another time.",
        robots=counted("one robot", "{count} robots", count=most),
        robot=first.label,
        start=wish.local(first.slot.starts_at),
        end=wish.local(first.slot.ends_at),
    )
    return _not_by(wish.policy, "robots_at_once", text, most=most, have=at_once)


def _robots_at(moment: datetime, slots: Sequence[Taken]) -> int:
    return len({one.label for one in slots if one.slot.starts_at <= moment < one.slot.ends_at})


def with_gap(wish: Wish) -> Refusal | None:
    """Check the gap between two bookings of this robot by the same person."""
    return _near(wish, wish.own_here)


def with_gap_after(wish: Wish) -> Refusal | None:
    """Check the gap to later bookings: a person may get back the rest of a slot."""
    return _near(wish, [slot for slot in wish.own_here if slot.starts_at >= wish.slot.ends_at])


def _near(wish: Wish, others: Sequence[Slot]) -> Refusal | None:
    gap = timedelta(minutes=wish.policy.gap_min)
    around = Slot(wish.slot.starts_at - gap, wish.slot.ends_at + gap)
    near = [slot for slot in others if slot.overlaps(around)]
    if not gap or not near:
        return None
    text = say(
        "Leave {gap} between your bookings of {robot}: you have one from {start:when} to {end:when}.",
        gap=duration(wish.policy.gap_min),
        robot=wish.robot,
        start=wish.local(near[0].starts_at),
        end=wish.local(near[0].ends_at),
    )
    return _not_by(wish.policy, "gap", text, gap_min=wish.policy.gap_min)


RULES: tuple[Rule, ...] = (
    in_order,
    not_in_past,
    ends_some_day,
    has_role,
    by_a_course,
    qualified,
    is_free,
    in_service,
    in_opening_hours,
    not_on_holiday,
    long_enough,
    short_enough,
    within_horizon,
    with_notice,
    within_day_quota,
    within_week_quota,
    within_course_day_quota,
    within_course_week_quota,
    within_common_quota,
    within_count,
    within_course_count,
    within_robots_at_once,
    with_gap,
)
COURSE_QUOTAS: tuple[Rule, ...] = (
    within_course_day_quota,
    within_course_week_quota,
    within_common_quota,
    within_course_count,
)
# Rules for an offered slot or the rest of a slot that runs: rights, room in the quotas, and the gap to
# the next booking. The slot itself was allowed before.
REST: tuple[Rule, ...] = (
    has_role,
    by_a_course,
    qualified,
    within_day_quota,
    within_week_quota,
    within_count,
    *COURSE_QUOTAS,
    within_robots_at_once,
    with_gap_after,
)
# Nobody can override these rules. People who manage the robot may override others, with a recorded reason.
BINDING: tuple[Rule, ...] = (in_order, not_in_past, ends_some_day, is_free)


def refusals(wish: Wish, rules: Sequence[Rule] = RULES) -> list[Refusal]:
    """Return all refusals of a wish by these rules. `BINDING`: for a person who overrides the policy.

    An impossible slot (backwards, too long, too far ahead) gets only this one refusal.
    """
    for beyond in (in_order, ends_some_day):
        if (first := beyond(wish)) is not None:
            return [first]
    if wish.slot.ends_at - wish.now > timedelta(days=MOST_DAYS):
        return [
            _no(
                "too_far",
                say(
                    "{end:when} is more than ten years ahead: look at the year.",
                    end=wish.local(wish.slot.ends_at),
                ),
            )
        ]
    found = (rule(wish) for rule in rules)
    return [refusal for refusal in found if refusal is not None]


def lost_right(wish: Wish) -> Refusal | None:
    """Return a refusal if the person may not use a booking any more: role or qualification are missing."""
    return has_role(wish) or (qualified(wish) if wish.missing else None)


def check_cancel(slot: Slot, policy: Policy, now: datetime) -> Refusal | None:
    """Check cancelling: the booking must not be over, and the policy may demand notice.

    A slot that has begun needs no notice: it is finished, not cancelled.
    """
    if now >= slot.ends_at:
        return _no("over", "This booking is over.")
    notice = policy.cancel_notice_min
    if notice and slot.starts_at > now > slot.starts_at - timedelta(minutes=notice):
        text = say(
            "A booking is cancelled at least {notice} before it begins. Ask the staff.",
            notice=duration(notice),
        )
        return _not_by(policy, "late_to_cancel", text, cancel_notice_min=notice)
    return None


# --- days and weeks of the lab --------------------------------------------------------------------


def day_of(day: date, lab: ZoneInfo) -> Slot:
    """Return a day of the lab's zone as a slot in UTC. It has 23, 24 or 25 hours."""
    return Slot(zones.start_of(day, lab), zones.end_of(day, lab))


def week_of(day: date, lab: ZoneInfo) -> Slot:
    """Return the week of a day, Monday to Sunday in the lab's zone, as a slot in UTC."""
    monday = day - timedelta(days=day.weekday())
    return Slot(day_of(monday, lab).starts_at, day_of(monday + timedelta(days=7), lab).starts_at)


def _days(wish: Wish) -> list[Slot]:
    return [day_of(day, wish.lab) for day in _dates(wish.slot, wish.lab)]


def _weeks(wish: Wish) -> list[Slot]:
    weeks = {week_of(day, wish.lab) for day in _dates(wish.slot, wish.lab)}
    return sorted(weeks, key=lambda week: week.starts_at)


def _dates(slot: Slot, lab: ZoneInfo) -> Iterator[date]:
    day = slot.starts_at.astimezone(lab).date()
    ends = min(slot.ends_at, slot.starts_at + LONGEST)  # a longer slot is refused anyway
    while day_of(day, lab).starts_at < ends:
        yield day
        day += timedelta(days=1)


# --- typed local times ----------------------------------------------------------------------------


def to_utc(local: datetime, zone: ZoneInfo, *, is_end: bool = False) -> datetime | Refusal:
    """Return the moment of a wall-clock time without zone.

    If the clock skips the time, because daylight saving begins, return a refusal. If the clock shows the time
    twice, return the first moment. An end at the first time that is skipped is the moment of the change: until
    00:00, where clocks go from 23:59 to 01:00.
    """
    local = local.replace(fold=0)
    utc = local.replace(tzinfo=zone).astimezone(UTC)
    if is_end and _wall(utc - INSTANT, zone) == local - INSTANT:
        return utc
    if _wall(utc, zone) != local:
        text = say(
            "{local:clock} does not exist on {local:day}: clocks go forward then. Choose a later time.",
            local=local,
        )
        return _no("time_gap", text)
    return utc


def moments_of(local: datetime, zone: ZoneInfo) -> list[datetime]:
    """Return the moments of a wall-clock time without zone: two, if clocks go back and show it twice, none in a gap."""
    moments = {local.replace(tzinfo=zone, fold=fold).astimezone(UTC) for fold in (0, 1)}
    return sorted(moment for moment in moments if _wall(moment, zone) == local)


def _wall(moment: datetime, zone: ZoneInfo) -> datetime:
    return moment.astimezone(zone).replace(tzinfo=None, fold=0)
