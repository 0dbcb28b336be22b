"""Figures of script/soak attacks: broken limits, and the reports about them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from benchmarks.attacks import stop_side, web_side
from benchmarks.attacks.catalogue import ATTACKS
from benchmarks.attacks.doors import COMMAND_LINE, NAMES, door
from benchmarks.attacks.figures import Limits, Press, Taken, broken, figures, table
from benchmarks.attacks.incidents import INCIDENTS

PRESS = Press(zero_s=0.01, confirmed_s=0.1, gap_s=0.05, moved_radps=0.0)
WEB = Limits(times=1.5)


def taken(*presses: Press, delays_s: tuple[float, ...] = (0.002,)) -> Taken:
    return Taken(
        list(presses or [PRESS]),
        delays_s=list(delays_s),
        sent=len(delays_s),
        records=10,
        answered_s=[0.03],
        answers={"page: sent": 1, "REST: 200": 1},
    )


def faults(attacked: Taken, limits: Limits = WEB) -> list[str]:
    return broken(figures(attacked, taken(), limits), attacked)


def test_an_attack_that_changes_nothing_breaks_nothing():
    assert faults(taken()) == []


@pytest.mark.parametrize(
    ("change", "figure"),
    [
        ({"zero_s": 0.36}, "stop worst"),
        ({"zero_s": math.inf}, "stop worst"),
        ({"gap_s": 0.11}, "gap between zeros"),
        ({"moved_radps": 0.4}, "moved while stopped"),
    ],
)
def test_one_bad_press_of_many_breaks_its_limit(change, figure):
    attacked = taken(PRESS, replace(PRESS, **change), PRESS)
    assert any(fault.startswith(figure) for fault in faults(attacked))


def test_delay_limits_apply_to_the_web_door_only():
    slow = taken(delays_s=(0.0031,))
    assert any("drive p99" in fault for fault in faults(slow))
    assert faults(slow, Limits()) == []


def test_slots_in_which_nothing_was_measured_hold_nothing():
    assert any("stop worst" in fault for fault in faults(Taken()))


def test_a_late_or_failing_door_breaks_a_limit():
    late, pending, refused = taken(), taken(), taken()
    late.answered_s.append(3.1)
    pending.answers["REST: 202"] = 1
    refused.answers["form: 502"] = 1
    assert any("answered worst" in fault for fault in faults(late, Limits()))
    assert faults(pending, Limits()) == []
    assert faults(refused, Limits()) == ["answer of a door: form: 502"]


def test_quick_presses_count_for_the_delay_of_the_stop():
    attacked = taken(*[PRESS] * 20)
    attacked.quick += [("REST", 0.009)] * 99 + [("REST", 0.3)]
    assert faults(attacked) == []  # one late stop in a hundred is allowed
    attacked.quick += [("REST", 0.3)] * 3
    assert any("stop p99 / as usual" in fault for fault in faults(attacked))


def test_lost_control_breaks_a_web_attacks_limit():
    lost = taken()
    lost.control_lost = 1
    assert any("control lost" in fault for fault in faults(lost))


def test_records_are_counted_per_second():
    attacked = taken(PRESS, PRESS)
    attacked.records, attacked.lasted_s = 30, 4.0
    [records] = [one for one in figures(attacked, taken(), WEB) if one.name == "records"]
    assert (records.value, records.unit) == (7.5, "/s")


def test_slots_of_one_kind_add_up():
    whole = Taken()
    for memory_mb in (90.0, 120.0, 100.0):
        slot = taken()
        slot.bridge_mb, slot.halts = (memory_mb, memory_mb), {"dead_man": 1}
        whole.add(slot)
    assert (len(whole.presses), whole.sent, whole.records) == (3, 3, 30)
    assert whole.bridge_mb == (90.0, 120.0)
    assert whole.halts == {"dead_man": 3}


def test_the_table_marks_unmeasured_and_missing_figures():
    never = taken(replace(PRESS, zero_s=math.inf), delays_s=())
    text = table([("attack", figures(never, taken(), WEB), ["a fault"])])
    assert "never" in text and "-" in text and text.endswith("BROKEN")


def test_every_stop_door_is_pressed_in_turn():
    pressed = [door(number) for number in range(10)]
    assert set(pressed) == {*NAMES, COMMAND_LINE}
    assert pressed.count(COMMAND_LINE) == 1


def test_every_attack_has_its_attacker():
    names = [attack.name for attack in ATTACKS]
    assert len(set(names)) == len(names)
    assert {attack.name for attack in ATTACKS if attack.side == "web"} == set(web_side.ROLES)
    assert {attack.name for attack in ATTACKS if attack.side == "stop"} == set(stop_side.ROLES)
    assert {attack.name for attack in ATTACKS if attack.side == "incident"} == set(INCIDENTS)
