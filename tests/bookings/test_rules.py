"""The rules of booking. No database, no clock."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import msgspec
import pytest

from fleet.bookings.models import Policy
from fleet.bookings.rules import BINDING, Quota, Slot, Taken, Wish, check_cancel, refusals, to_utc
from robots.access.models import RobotGroup
from robots.registry.models import Role
from robots.shared.wire import Refusal

MADRID = ZoneInfo("Europe/Madrid")
NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)  # a Monday


def slot(begins_h, hours=1.0):
    starts = NOW + timedelta(hours=begins_h)
    return Slot(starts, starts + timedelta(hours=hours))


def wish(when=None, **facts):
    policy = Policy(**{name: facts.pop(name) for name in list(facts) if hasattr(Policy, name)})
    facts = {"role": Role.OPERATOR, "zone": MADRID} | facts
    return Wish(robot="Tiago", slot=when or slot(1), now=NOW, policy=policy, lab=MADRID, **facts)


def codes(wanted, **options):
    return [refusal.code for refusal in refusals(wanted, **options)]


def test_a_plain_slot_is_allowed():
    assert codes(wish()) == []


@pytest.mark.parametrize(
    ("code", "wanted"),
    {
        "zero_length": wish(slot(1, 0)),
        "backwards": wish(slot(1, -1)),
        "in_past": wish(slot(-1)),
        "too_far": wish(slot(24 * 29)),
        "too_short": wish(slot(1, 0.1)),
        "too_long": wish(slot(1, 5)),
        "short_notice": wish(notice_min=120),
        "role_too_low": wish(role=Role.OBSERVER),
        "unqualified": wish(missing=("safety induction",)),
        "taken": wish(taken=(Taken(slot(1), "Anna"),)),
        "out_of_service": wish(out=(Taken(slot(0, 9), "repair"),)),
        "closed": wish(opening={"tue": [["08:00", "20:00"]]}),
        "quota_day": wish(day_min=90, own=(slot(4),)),
        "quota_week": wish(week_min=90, own=(slot(30),)),
        "quota_open": wish(at_once=1, own=(slot(30),)),
        "robots_at_once": wish(other_robots=(Taken(slot(1.5), "Tiago 2"),)),
        "wrong_course": wish(wrong_course="HRI"),
        "gap": wish(gap_min=60, own_here=(slot(2.5),)),
    }.items(),
)
def test_each_rule_refuses_by_name(code, wanted):
    assert codes(wanted) == [code]


def test_a_policys_refusal_names_whose_policy_it_is():
    group = RobotGroup(name="the TIAGos")
    for policy, name in ((Policy(group=group), "the TIAGos"), (Policy(), "all robots")):
        [refusal] = refusals(msgspec.structs.replace(wish(slot(1, 5)), policy=policy))
        assert refusal.text.endswith(f"make it shorter. (Policy of {name}.)")
        assert refusal.figures["policy"] == name


def test_robots_at_once_count_where_they_overlap():
    one_after_another = (Taken(slot(1, 0.5), "Tiago 2"), Taken(slot(1.5, 0.5), "Tiago 3"))
    assert codes(wish(robots_at_once=2, other_robots=one_after_another)) == []
    together = (Taken(slot(0, 2), "Tiago 2"), Taken(slot(1.5), "Tiago 3"))
    assert codes(wish(robots_at_once=2, other_robots=together)) == ["robots_at_once"]
    assert codes(wish(other_robots=together, lesson=True)) == []
    assert codes(wish(other_robots=together), rules=BINDING) == []


def test_a_slot_ends_before_a_qualification_does():
    assert codes(wish(qualified_until=slot(1).ends_at)) == []
    assert codes(wish(qualified_until=slot(1, 0.5).ends_at)) == ["unqualified"]


def test_all_rules_that_refuse_are_reported_at_once():
    wanted = wish(slot(1, 5), missing=("induction",), taken=(Taken(slot(2), "Anna"),), day_min=60)
    assert codes(wanted) == ["unqualified", "taken", "too_long", "quota_day"]


def test_ten_thousand_years_ahead_is_one_plain_refusal():
    far = datetime(9999, 12, 31, tzinfo=UTC)
    assert codes(wish(Slot(far - timedelta(hours=1), far))) == ["too_far"]


def test_a_reason_overrides_the_policy_but_no_booking():
    wanted = wish(slot(1, 9), missing=("induction",), taken=(Taken(slot(2), "Anna"),))
    assert codes(wanted, rules=BINDING) == ["taken"]


def test_opening_hours_are_those_of_the_lab():
    hours = {"mon": [["10:00", "12:00"]]}  # 09:00 to 11:00 UTC in winter
    assert codes(wish(slot(0, 2), opening=hours)) == []
    assert codes(wish(slot(0, 2.5), opening=hours)) == ["closed"]


def test_a_slot_lies_within_one_opening_interval_or_in_touching_ones():
    hours = {day: [["08:00", "12:00"], ["13:00", "20:00"]] for day in ("mon", "tue", "wed")}
    assert codes(wish(slot(1), opening=hours)) == []  # 11:00 to 12:00 in Madrid
    [closed] = refusals(wish(slot(1, 2.5), opening={**hours, "sat": [["10:00", "12:00"]]}))
    assert closed.code == "closed"
    assert "booked Mon-Wed 08:00-12:00, 13:00-20:00; Sat 10:00-12:00 (Europe/Madrid)." in closed.text
    touching = {"mon": [["08:00", "12:00"], ["12:00", "20:00"]]}
    assert codes(wish(slot(1, 3), opening=touching)) == []


def test_a_slot_over_midnight_fits_two_open_days():
    hours = {"mon": [["08:00", "24:00"]], "tue": [["00:00", "08:00"]]}
    over_midnight = slot(13, 3)  # 23:00 to 02:00 in Madrid
    assert codes(wish(over_midnight, opening=hours)) == []
    assert codes(wish(over_midnight, opening={"mon": [["08:00", "24:00"]]})) == ["closed"]


@pytest.mark.parametrize(("month", "day", "hours"), [(3, 29, 23), (10, 25, 25), (6, 1, 24)])
def test_a_day_quota_covers_short_and_long_days(month, day, hours):
    begins = datetime(2026, month, day, tzinfo=MADRID).astimezone(UTC)
    whole_day = Slot(begins, begins + timedelta(hours=hours))
    now = begins - timedelta(days=1)
    facts = {"slot": whole_day, "now": now}
    fits = msgspec.structs.replace(wish(longest_min=1500, day_min=hours * 60), **facts)
    assert codes(fits) == []
    assert codes(msgspec.structs.replace(wish(longest_min=1500, day_min=hours * 60 - 1), **facts)) == [
        "quota_day"
    ]


def test_a_time_that_the_clock_skips_is_named():
    skipped = to_utc(datetime.fromisoformat("2026-03-29 02:30"), MADRID)
    assert isinstance(skipped, Refusal)
    assert (skipped.code, "does not exist on 29 Mar 2026" in skipped.text) == ("time_gap", True)


def test_a_time_shown_twice_is_the_first():
    assert to_utc(datetime.fromisoformat("2026-10-25 02:30"), MADRID) == datetime(
        2026, 10, 25, 0, 30, tzinfo=UTC
    )


def test_cancelling_asks_for_notice_only_before_the_start():
    policy = Policy(cancel_notice_min=60)
    assert check_cancel(slot(2), policy, NOW) is None
    assert check_cancel(slot(0.5), policy, NOW).code == "late_to_cancel"
    assert check_cancel(slot(-0.5), policy, NOW) is None


@pytest.mark.parametrize(
    ("code", "quota"),
    [
        ("quota_course_day", Quota("HRI", day_min=90, own=(slot(4),))),
        ("quota_course_week", Quota("HRI", week_min=90, own=(slot(30),))),
        ("quota_common_week", Quota("HRI", course_week_min=90, all=(slot(30),))),
        ("quota_course_open", Quota("HRI", at_once=1, own=(slot(30),))),
    ],
)
def test_quotas_of_a_course_name_the_course(code, quota):
    [refusal] = refusals(wish(quota=quota))
    assert refusal.code == code
    assert "HRI" in refusal.text
