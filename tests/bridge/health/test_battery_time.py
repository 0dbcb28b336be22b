"""The battery's remaining time, computed from how fast its charge fell."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from robots.bridge.health.battery_charge import BatteryCharge
from robots.bridge.health.battery_time import BatteryTime


def fed(*, per_hour: float, minutes: float, start: float = 80.0, whole: bool = False) -> BatteryTime:
    battery = BatteryTime()
    for second in range(0, int(minutes * 60) + 1):
        percent = start - per_hour * second / 3600.0
        battery.observe(round(percent) if whole else percent, None, float(second))
    return battery


@pytest.mark.parametrize(("per_hour", "left_min"), [(20.0, 210), (40.0, 90), (100.0, 15)])
def test_the_pace_of_the_last_half_hour_counts_rounded_down(per_hour, left_min):
    assert fed(per_hour=per_hour, minutes=30).left_min() == left_min


def test_nothing_is_said_too_soon_or_without_a_fall():
    assert fed(per_hour=20.0, minutes=4).left_min() is None
    assert fed(per_hour=0.0, minutes=60).left_min() is None


def test_whole_percents_are_enough():
    assert fed(per_hour=20.0, minutes=30, whole=True).left_min() == pytest.approx(210, abs=30)


def state(percentage, charge=math.nan, capacity=math.nan):
    return SimpleNamespace(percentage=percentage, charge=charge, capacity=capacity)


@pytest.mark.parametrize(
    ("messages", "percents"),
    [
        (
            [SimpleNamespace(data=63.0), SimpleNamespace(data=-1.0), SimpleNamespace(data=math.inf)],
            [63.0, None, None],
        ),
        ([state(0.97), state(1.1), state(0.5)], [97.0, pytest.approx(110.0), 50.0]),  # not calibrated
        ([state(63.0), state(1.0), state(0.5)], [63.0, 1.0, 0.5]),  # a driver that sends percent
        ([state(math.nan), state(-1.0)], [None, None]),  # only its voltage is known
        ([state(math.nan, 3.0, 12.0), state(math.nan, 3.0, 0.0)], [25.0, None]),
    ],
)
def test_the_charge_is_read_as_its_driver_means_it(messages, percents):
    charge = BatteryCharge()
    assert [charge.percent(message) for message in messages] == percents


def test_a_charger_another_battery_and_a_rise_begin_anew():
    for percent, charging in ((70.0, True), (20.0, None), (90.0, None)):
        battery = fed(per_hour=20.0, minutes=30)
        assert battery.left_min() is not None
        battery.observe(percent, charging, 1801.0)
        assert battery.left_min() is None
