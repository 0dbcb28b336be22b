"""The summary of nodes' reports on the robot's parts: levels with their ages, temperatures, size limits."""

from __future__ import annotations

import pytest

from robots.bridge.health import diagnostics as module
from robots.bridge.health.diagnostics import (
    FORGOTTEN_S,
    MOST_PARTS,
    MOST_VOICES,
    RESTARTED_S,
    SHOWN,
    SILENT_S,
    Diagnostics,
    Status,
    plain_name,
)
from tests.bridge.support import Bench

OK, WARN, ERROR, STALE = range(4)


@pytest.fixture
def diagnostics():
    return Diagnostics()


def test_nothing_heard_is_no_health(diagnostics):
    assert diagnostics.view(0.0) is None


def test_the_worst_part_comes_first_and_says_since_when(diagnostics):
    diagnostics.observe([Status("laser: scanner", WARN, "dirty"), Status("arm", OK, "OK")], 0.0)
    diagnostics.observe(
        [Status("left wheel", ERROR, "no current"), Status("laser: scanner", WARN, "dirty")], 5.0
    )
    health = diagnostics.view(8.0)
    assert (health.level, health.well) == ("error", 1)
    assert [(part.name, part.level, part.since_s) for part in health.parts] == [
        ("left wheel", "error", 3),
        ("laser: scanner", "warning", 8),
    ]
    diagnostics.observe([Status(name, OK, "OK") for name in ("left wheel", "laser: scanner", "arm")], 9.0)
    assert (diagnostics.view(9.0).level, diagnostics.view(9.0).well) == ("ok", 3)


def test_a_part_that_says_nothing_more_is_silent_then_forgotten(diagnostics):
    diagnostics.observe([Status("laser", OK, "OK", [("Temperature", "40")])], 0.0)
    assert diagnostics.view(SILENT_S).level == "ok"
    silent = diagnostics.view(SILENT_S + 5.0)
    assert [(part.level, part.since_s) for part in silent.parts] == [("silent", int(SILENT_S + 5.0))]
    assert silent.temperatures == []  # the present temperature is unknown
    assert diagnostics.view(FORGOTTEN_S + 1.0) is None
    diagnostics.observe([Status("laser", STALE, "driver says so")], FORGOTTEN_S + 2.0)
    assert diagnostics.view(FORGOTTEN_S + 2.0).level == "silent"


@pytest.mark.parametrize("stale", [False, True], ids=["silent", "called stale by an aggregator"])
def test_an_error_that_falls_silent_stays_an_error(diagnostics, stale):
    diagnostics.observe([Status("amplifier", ERROR, "no answer"), Status("arm", OK, "OK")], 0.0)
    for now_s in (SILENT_S + 50.0, FORGOTTEN_S + 100.0):
        if stale:
            diagnostics.observe([Status("amplifier", STALE, "stale")], 0.1)
        diagnostics.observe([Status("arm", OK, "OK")], now_s)
        health = diagnostics.view(now_s)
        assert (health.level, health.well, health.parts[0].level) == ("error", 1, "error")
        assert health.parts[0].since_s == int(now_s)
        assert health.parts[0].text.startswith("no answer; silent for ")
    assert health.parts[0].text == "no answer; silent for 12 min"
    diagnostics.observe([Status("amplifier", OK, "OK")], now_s)
    assert (diagnostics.view(now_s).level, diagnostics.view(now_s).well) == ("ok", 2)


def test_an_error_back_after_a_silence_is_as_old_as_before(diagnostics):
    broken = Status("amplifier", ERROR, "no answer")
    others = [Status(f"motor {number}", ERROR, "") for number in range(SHOWN - 1)]
    diagnostics.observe([Status(name, OK, "") for name in ("arm", "head", "laser")], 0.0)
    diagnostics.observe([broken], 1.0)
    diagnostics.observe(others, 2.0)
    diagnostics.observe([Status(name, ERROR, "") for name in ("arm", "head", "laser")], 3.0)
    diagnostics.view(50.0)  # no reports arrived: the robot's network was away
    assert diagnostics.members(50.0)["amplifier"].level == "silent"
    first = diagnostics.view(50.0).parts[0]
    assert (first.name, first.since_s) == ("amplifier", 49), "the oldest"
    diagnostics.observe([broken, *others], 60.0)
    first = diagnostics.view(60.0).parts[0]
    assert (first.name, first.text, first.since_s) == ("amplifier", "no answer", 59)
    diagnostics.observe([Status(name, ERROR, "") for name in ("arm", "head", "laser")], 60.0)
    names = [part.name for part in diagnostics.view(60.0).parts]
    assert names[-3:] == ["arm", "head", "laser"], "the newest"
    diagnostics.observe([Status("amplifier", OK, "")], 61.0)
    diagnostics.observe([broken], 62.0)
    assert diagnostics.view(62.0).parts[-1].since_s == 0


def test_a_silent_error_that_is_older_comes_before_a_newer_one(diagnostics):
    diagnostics.observe([Status("zoom", ERROR, "")], 0.0)
    diagnostics.observe([Status("arm", ERROR, "")], 5.0)
    diagnostics.observe([Status("zoom", ERROR, "")], 8.0)  # the last report on zoom
    for now_s in range(9, 40):
        diagnostics.observe([Status("arm", ERROR, "")], float(now_s))
    assert [part.since_s for part in diagnostics.view(40.0).parts] == [40, 35]


def test_an_error_that_is_a_warning_after_a_silence_got_no_worse(diagnostics):
    diagnostics.observe([Status("arm", ERROR, "")], 0.0)
    diagnostics.members(20.0)
    diagnostics.observe([Status("arm", WARN, "")], 20.0)
    arm = diagnostics.members(20.0)["arm"]
    assert (arm.since_s, arm.got_worse) == (20.0, False)


@pytest.mark.parametrize("stale", [False, True], ids=["silent", "called stale by an aggregator"])
def test_an_error_does_not_outlive_the_robots_restart(diagnostics, stale):
    old, stays, well = (Status(name, ERROR, "broken") for name in ("gone", "stays", "arm"))
    well = well._replace(level=OK)
    diagnostics.observe([old, stays, well], 0.0)
    diagnostics.restarted(30.0)
    for now_s in range(31, 30 + int(RESTARTED_S) + 2):
        diagnostics.observe([Status("gone", STALE, "")] if stale else [], float(now_s))
        diagnostics.observe([stays, well], float(now_s))
        parts = {part.name: part.level for part in diagnostics.view(float(now_s)).parts}
        is_over = now_s - 30 > RESTARTED_S
        assert parts == {"stays": "error", "gone": "silent" if is_over else "error"}
    assert diagnostics.view(float(now_s)).parts[0].since_s == now_s
    if not stale:
        diagnostics.observe([stays, well], FORGOTTEN_S + 1.0)
        assert [part.name for part in diagnostics.view(FORGOTTEN_S + 1.0).parts] == ["stays"]
    diagnostics.observe([old], 700.0)
    assert diagnostics.members(700.0)["gone"].shown == "error", "it is heard again"
    diagnostics.members(800.0)
    assert diagnostics.members(800.0)["gone"].shown == "error", "an error of this run"


def test_the_bridge_tells_of_a_restart():
    bench = Bench().online()
    bench.core.reports.diagnostics.observe([Status("gone", ERROR, "broken")], bench.now_s)
    bench.core.restarted(bench.now_s + 20.0)
    assert bench.core.state(bench.now_s + 20.0, []).health.level == "error"
    assert bench.core.state(bench.now_s + 21.0 + RESTARTED_S, []).health.level == "silent"
    bench.close()


def test_silent_parts_that_were_ill_make_room(diagnostics):
    diagnostics.observe([Status(f"part {number}", ERROR, "") for number in range(MOST_PARTS)], 0.0)
    diagnostics.observe([Status("arm", ERROR, "broken")], FORGOTTEN_S + 1.0)
    assert [part.name for part in diagnostics.view(FORGOTTEN_S + 1.0).parts] == ["arm"]


def test_the_newest_changes_for_the_worse_are_shown(diagnostics):
    diagnostics.observe([Status(f"motor {number}", ERROR, "") for number in range(SHOWN + 4)], 0.0)
    assert [part.name for part in diagnostics.view(0.0).parts] == [
        f"motor {name}" for name in (0, 1, 10, 11, 2, 3, 4, 5)
    ]
    well = [Status(name, OK, "") for name in ("laser", "arm", "head", "motor 0")]
    diagnostics.observe(well, 1.0)
    for at_s, name in enumerate(("laser", "arm", "head"), 2):
        diagnostics.observe([Status(name, WARN, "warm")], float(at_s))
    names = [part.name for part in diagnostics.view(5.0).parts]
    assert names == ["motor 1", "motor 10", "motor 11", "motor 2", "motor 3", "laser", "arm", "head"]
    diagnostics.observe([Status("motor 1", WARN, "better")], 6.0)
    assert [part.name for part in diagnostics.view(6.0).parts][-3:] == ["laser", "arm", "head"]


def test_groups_of_an_aggregator_are_not_counted_beside_their_members(diagnostics):
    diagnostics.observe(
        [
            Status("/Hardware", ERROR, "Error"),
            Status("/Hardware/Motors", ERROR, "Error"),
            Status("/Hardware/Motors/left wheel", ERROR, "over current"),
            Status("/Software", OK, "OK"),
        ],
        0.0,
    )
    health = diagnostics.view(0.0)
    assert [part.name for part in health.parts] == ["left wheel"] and health.well == 1
    assert plain_name("node: part") == "node: part"
    sides = ("/Devices/Left/Driver", "/Devices/Right/Driver")
    diagnostics.observe([Status(name, WARN, "") for name in sides], 0.0)
    assert [part.name for part in diagnostics.view(0.0).parts[1:]] == list(sides)  # equal short names


def levels(diagnostics, now_s):
    return {part.name: part.level for part in diagnostics.view(now_s).parts}


@pytest.mark.parametrize("order", [1, -1])
def test_the_worst_of_a_name_within_a_message_holds(diagnostics, order):
    said = [
        Status("motor", OK, "fine", [("temp", "40")]),
        Status("motor", ERROR, "broken", [("temp_2", "50")]),
    ]
    diagnostics.observe([*said, Status("motor", WARN, "warm"), Status("motor", 7, "?")][::order], 0.0)
    health = diagnostics.view(0.0)
    assert [(part.level, part.text) for part in health.parts] == [("error", "broken")]
    assert (health.unread, health.well) == (1, 0)
    assert [one.celsius for one in health.temperatures] == [50, 40]


@pytest.mark.parametrize("differ", ["node", "hardware"])
def test_two_voices_of_one_name_show_the_worst_steadily(diagnostics, differ):
    ill, well = (Status("driver", level, text, **{differ: who}) for level, text, who in VOICES)
    shown = []
    for now_s in range(20):
        diagnostics.observe([(ill, well)[now_s % 2]], float(now_s))
        shown += [(part.level, part.text, part.since_s) for part in diagnostics.view(float(now_s)).parts]
    assert shown == [("error", "no current" + (" (b)" if now_s else ""), now_s) for now_s in range(20)]
    diagnostics.observe([ill._replace(level=OK), well], 20.0)
    assert levels(diagnostics, 20.0) == {}
    assert diagnostics.members(20.0)["driver"].since_s == 20.0


VOICES = ((ERROR, "no current", "b"), (OK, "OK", "a"))


def test_a_node_that_comes_back_under_another_name_replaces_the_old(diagnostics):
    diagnostics.observe([Status("driver", ERROR, "no current", node="/driver_1")], 0.0)
    for now_s in range(1, int(SILENT_S) + 5):
        diagnostics.observe([Status("driver", OK, "OK", node="/driver_2")], float(now_s))
        assert levels(diagnostics, float(now_s)) == ({"driver": "error"} if now_s <= SILENT_S else {})


def test_a_part_with_only_a_hardware_id_is_called_by_it(diagnostics):
    diagnostics.observe(
        [Status("", ERROR, "", hardware="arm_7"), Status(" / ", ERROR, "", hardware="/")], 0.0
    )
    assert (levels(diagnostics, 0.0), diagnostics.view(0.0).unread) == ({"arm_7": "error"}, 1)


@pytest.mark.parametrize("count", [MOST_VOICES + 1, 20])
@pytest.mark.parametrize("is_first", [True, False], ids=["ill first", "ill last"])
@pytest.mark.parametrize("ill", [1, MOST_VOICES + 1])
def test_an_ill_voice_yields_to_none_that_is_well(diagnostics, count, is_first, ill):
    levels = [ERROR] * ill + [OK] * (count - ill)
    said = [
        Status("motor", level, "hot", hardware=f"hw{number}")
        for number, level in enumerate(levels if is_first else levels[::-1])
    ]
    for now_s in range(5):
        diagnostics.observe(said, float(now_s))
    health = diagnostics.view(4.0)
    assert [(part.level, part.since_s) for part in health.parts] == [("error", 4)]
    assert health.left_out == (ill > MOST_VOICES)


def test_a_well_voice_takes_the_place_of_a_silent_ill_one(diagnostics):
    diagnostics.observe(
        [Status("motor", ERROR, "hot", hardware=f"hw{one}") for one in range(MOST_VOICES)], 0.0
    )
    diagnostics.observe([Status("motor", OK, "OK", hardware="new")], SILENT_S + 1.0)
    assert diagnostics.view(SILENT_S + 1.0).level == "ok"


def test_names_that_change_their_hardware_id_fill_nothing(diagnostics):
    for now_s in range(300):
        diagnostics.observe([Status("clock", OK, "", hardware=f"id {now_s}")], float(now_s))
    diagnostics.observe([Status("arm", ERROR, "")], 300.0)
    health = diagnostics.view(300.0)
    assert (health.left_out, health.well, len(health.parts)) == (0, 1, 1)


def test_an_ill_part_takes_the_place_of_one_that_is_well(diagnostics):
    diagnostics.observe([Status(f"part {number}", OK, "") for number in range(MOST_PARTS + 3)], 0.0)
    diagnostics.observe([Status("arm", ERROR, "")], 1.0)
    health = diagnostics.view(1.0)
    assert [part.name for part in health.parts] == ["arm"]
    assert (health.well, health.left_out) == (MOST_PARTS - 1, 4)


def test_a_group_that_alone_is_ill_is_shown(diagnostics):
    diagnostics.observe([Status("/arm", ERROR, "stuck"), Status("/arm/joint", OK, "")], 0.0)
    assert levels(diagnostics, 0.0) == {"arm": "error"}
    diagnostics.observe([Status("/arm", ERROR, "stuck"), Status("/arm/joint", WARN, "warm")], 1.0)
    assert levels(diagnostics, 1.0) == {"joint": "warning"}


@pytest.mark.parametrize(
    ("key", "value", "celsius"),
    [
        ("Temperature", "84.2", 84),
        ("temp", "-3 C", -3),
        ("core_temp", "51°C", 51),
        ("CPU temperature (C)", " 60.5 celsius ", 60),
        ("temperature", "nan", None),
        ("temperature", "1e30", None),
        ("temperature", "hot", None),
        ("temperature", "999", None),
        ("temporary files", "12", None),
        ("template", "12", None),
    ],
)
def test_temperatures_are_read_where_they_can_be(diagnostics, key, value, celsius):
    diagnostics.observe([Status("motor", OK, "OK", [(key, value)])], 0.0)
    assert [one.celsius for one in diagnostics.view(0.0).temperatures] == (
        [] if celsius is None else [celsius]
    )


def test_the_hottest_comes_first_and_two_of_a_part_are_told_apart(diagnostics):
    diagnostics.observe(
        [
            Status("motor", OK, "", [("winding temperature", "80"), ("board temperature", "40")]),
            Status("cpu", OK, "", [("temp", "60")]),
        ],
        0.0,
    )
    assert [one.name for one in diagnostics.view(0.0).temperatures] == [
        "motor, winding temperature",
        "cpu",
        "motor, board temperature",
    ]


def test_a_flood_of_names_is_bounded_and_counted(diagnostics):
    for second in range(20):
        diagnostics.observe([Status(f"part {second} {i}", WARN, "x") for i in range(300)], float(second))
    health = diagnostics.view(19.0)
    assert len(health.parts) == SHOWN and health.parts_more == MOST_PARTS - SHOWN
    assert health.left_out == MOST_PARTS  # the count ends at this number
    diagnostics.observe([Status("arm", ERROR, "broken")], FORGOTTEN_S + 20.0)
    assert diagnostics.view(FORGOTTEN_S + 20.0).parts[0].name == "arm"  # there is room again


def test_a_flood_of_ill_names_looks_at_each_part_once(diagnostics, monkeypatch):
    diagnostics.observe([Status(f"part {number}", ERROR, "hot") for number in range(MOST_PARTS)], 0.0)
    looks, chosen = [], module._chosen
    monkeypatch.setattr(module, "_chosen", lambda *given: looks.append(given) or chosen(*given))
    diagnostics.observe([Status(f"other {number}", ERROR, "hot") for number in range(500)], 1.0)
    assert len(looks) <= MOST_PARTS


def test_unreadable_reports_are_counted(diagnostics):
    diagnostics.observe([Status("arm", 7, ""), Status("///", ERROR, ""), Status("", OK, "")], 0.0)
    assert (diagnostics.view(0.0).level, diagnostics.view(0.0).unread) == ("ok", 3)
