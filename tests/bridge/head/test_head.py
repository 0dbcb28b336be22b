"""The head looks ahead on the holder's recorded request, and into a turn if this is configured."""

import math

import msgspec
import pytest

from robots.bridge.audit.records import unrecorded
from robots.bridge.head.head import (
    AHEAD_TAKES_S,
    ARRIVED_S,
    DOWN_S,
    FOLLOW_RAD,
    FOLLOW_RADPS,
    TURN_RADPS,
    Head,
)
from robots.bridge.head.head_tasks import HeadTasks
from robots.bridge.head.turning import STILL_S
from robots.shared import wire
from robots.shared.configuration.bridge_config import HeadSource
from robots.shared.geometry.poses import Velocity
from tests.bridge.support import CONFIG, Bench, Outcome, codes, settled

SOURCE = HeadSource("/head_controller/command", "head_1_joint", "head_2_joint", look_tilt=-0.68)
FOLLOWS = msgspec.structs.replace(SOURCE, follows_turn=True)


def with_head(source=SOURCE):
    topics = msgspec.structs.replace(CONFIG.topics, head=source)
    return Bench(config=msgspec.structs.replace(CONFIG, topics=topics)).online().granted()


@pytest.fixture
def bench():
    return with_head()


def ask(bench, fence=1, link=1):
    """Send the request; return its answers so far."""
    return bench.ask(wire.LookAhead(fence), link)


def others_play(bench):
    bench.core.tasks.motions.running("/play_motion", ["other"], bench.now_s)


def turn(bench):
    for _ in range(4):
        bench.stick(0.5, 0.5)
        bench.pass_time(0.1)


def test_head_moves_when_the_request_is_recorded(bench):
    bench.sink.open.clear()
    answers = ask(bench)
    bench.core.tick(bench.now_s)
    assert (bench.base.aims, answers) == ([], [])
    bench.sink.open.set()
    settled(bench)
    [aim] = bench.base.aims
    assert (aim.pan, aim.tilt) == (0.0, SOURCE.tilt_rad[0]), "down first"
    assert answers == [None]
    assert bench.sink.records == [("head.look_ahead", {}), ("head.look_ahead", Outcome("sent"))]


def test_a_head_that_looked_down_looks_up_to_the_floor_ahead_once(bench):
    ask(bench)
    settled(bench)
    bench.pass_time(AHEAD_TAKES_S + DOWN_S - 0.1)
    assert len(bench.base.aims) == 1
    bench.pass_time(10.0)
    assert [(aim.pan, aim.tilt) for aim in bench.base.aims[1:]] == [(0.0, -0.68)]


def test_a_head_looks_at_a_remembered_place_and_sweeps_back_slowly():
    head = Head(SOURCE)
    aims = [head.ahead(-0.8, 10.0)]
    for step in range(200):
        if aim := head.onward(10.0 + 0.05 * step):
            aims.append(aim)
    lowest = SOURCE.tilt_rad[0]
    assert [aim[:2] for aim in aims] == [(-0.8, lowest), (0.0, lowest), (0.0, -0.68)]
    assert aims[1].seconds == pytest.approx(0.8 / FOLLOW_RADPS), "so slowly that its pictures count"
    assert Head(SOURCE).ahead(3.0, 10.0).pan == SOURCE.pan_rad[1]


def test_a_head_that_looks_ahead_follows_no_turn_until_it_is_up():
    head = Head(FOLLOWS)
    head.ahead(None, 10.0)
    assert head.follow(Velocity(0.5, 0.0, 1.0), 11.0) is None
    head.turn(0.1, 0.0, None, 11.0)
    assert head.onward(60.0) is None, "its holder has turned it by hand meanwhile"


@pytest.mark.parametrize("spoil", [lambda bench: bench.core.stop("Bob", "", bench.now_s), others_play])
def test_what_forbids_to_move_the_head_leaves_it_down(bench, spoil):
    ask(bench)
    settled(bench)
    for _ in range(8):
        spoil(bench)
        bench.pass_time(0.5)
    assert len(bench.base.aims) == 1


def stopped_and_cleared(bench):
    bench.core.stop("Bob", "", bench.now_s)
    bench.pass_time(0.5)
    assert bench.core.clear(1, bench.now_s) is None


def unrecorded_for_a_while(bench):
    refusal = unrecorded("the disk is full", [])
    bench.core.tasks.unrecorded(refusal, bench.now_s)


@pytest.mark.parametrize("spoil", [stopped_and_cleared, unrecorded_for_a_while])
def test_a_head_that_was_stopped_on_its_way_does_not_go_on_by_itself(bench, spoil):
    ask(bench)
    settled(bench)
    spoil(bench)
    bench.pass_time(10.0)
    assert len(bench.base.aims) == 1


def test_each_request_is_recorded_and_answered(bench):
    answers = ask(bench), ask(bench)
    settled(bench)
    bench.pass_time(0.1)
    assert answers == ([None], [None])
    assert bench.sink.kinds == ["head.look_ahead"] * 4


def test_unrecorded_request_is_refused_and_not_done(bench):
    bench.sink.fails = "disk full"
    answers = ask(bench)
    settled(bench)
    assert bench.base.aims == []
    assert codes(answers) == ["not_recorded"]


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.core.revoke(1, "over", bench.now_s) or bench.granted(2), "halted"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "halted"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s) or bench.core.clear(1, bench.now_s), "halted"),
        (lambda bench: others_play(bench), "motion_running"),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
    ],
)
def test_event_before_the_record_prevents_moving_the_head(bench, spoil, code):
    bench.sink.open.clear()
    answers = ask(bench)
    spoil(bench)
    bench.sink.open.set()
    settled(bench)
    assert bench.base.aims == []
    assert codes(answers) == [code]
    assert bench.sink.records[-1] == ("head.look_ahead", Outcome(code))


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: others_play(bench), "motion_running"),
        (lambda bench: setattr(bench.base, "listeners", 0), "robot_offline"),
    ],
)
def test_a_forbidden_look_is_refused_and_not_recorded(bench, spoil, code):
    spoil(bench)
    assert codes(ask(bench)) == [code]
    settled(bench)
    assert bench.base.aims == []
    assert "head.look_ahead" not in bench.sink.kinds


def test_only_the_holder_is_obeyed(bench):
    assert codes(ask(bench, fence=2)) == ["unknown_fence"]
    assert codes(ask(bench, link=5)) == ["other_link"]


def test_a_robot_without_a_head_says_so():
    assert codes(ask(Bench().online().granted())) == ["no_head"]


def test_the_head_follows_a_turn_slowly_and_not_too_far():
    head = Head(FOLLOWS)
    pans = [0.0]
    for step in range(100):
        if aim := head.follow(Velocity(0.5, 0.0, 1.5), 10.0 + 0.05 * step):
            pans.append(aim.pan)
            assert (pans[-1] - pans[-2]) / aim.seconds <= FOLLOW_RADPS + 1e-9
    assert FOLLOW_RAD - 0.03 < pans[-1] <= FOLLOW_RAD
    back = [head.follow(Velocity(0.5, 0.0, 0.0), 20.0 + 0.05 * step) for step in range(100)]
    assert [aim for aim in back if aim][-1].pan == pytest.approx(0.0, abs=0.03)


def test_head_is_sent_ahead_repeatedly_on_a_straight_drive():
    head = Head(FOLLOWS)
    aims = [head.follow(Velocity(0.5, 0.0, 0.0), 10.0 + 0.05 * step) for step in range(101)]
    assert [aim for aim in aims if aim] == [(0.0, -0.68, AHEAD_TAKES_S)] * 3


@pytest.mark.parametrize(
    "twist", [Velocity(0.0, 0.0, 1.0), Velocity(-0.2, 0.0, 1.0), Velocity(0.0, 0.0, 0.0)]
)
def test_head_follows_only_forward_drives(twist):
    assert Head(FOLLOWS).follow(twist, 10.0) is None


def test_head_follows_only_if_configured():
    assert Head(SOURCE).follow(Velocity(0.5, 0.0, 1.0), 10.0) is None


def test_head_is_not_moved_during_a_motion():
    bench = with_head(FOLLOWS)
    bench.driving(0.5)
    bench.base.aims.clear()
    bench.core.tasks.motions.running("/play_motion", ["other"], bench.now_s)
    turn(bench)
    assert bench.base.aims == []
    bench.core.tasks.motions.running("/play_motion", [], bench.now_s)
    bench.stick(0.0)
    turn(bench)
    assert bench.base.aims


def test_looking_ahead_shows_floor_from_half_to_three_metres():
    """TIAGo at home: camera 1.217 m high, 0.175 m in front of the base's centre, 49.4 degrees vertical view."""
    half = math.atan(240 / (320 / math.tan(math.radians(31.5))))
    nearest, farthest = (1.217 / math.tan(-SOURCE.look_tilt + side) + 0.175 - 0.27 for side in (half, -half))
    assert nearest <= 0.51
    assert farthest >= 3.0


def drag(bench, pan, tilt, fence=1):
    return bench.ask(wire.TurnHead(fence, pan, tilt), 1)


def test_one_record_stands_for_the_turns_of_a_drag(bench):
    answers = drag(bench, 0.2, -0.1)
    settled(bench)
    for _ in range(5):
        answers += drag(bench, 0.1, 0.0)
        bench.pass_time(0.2)
    assert answers == [None] * 6
    assert bench.sink.kinds == ["head.turn"] * 2
    assert (bench.base.aims[-1].pan, bench.base.aims[-1].tilt) == pytest.approx((0.7, -0.1))


def test_turns_after_a_pause_are_recorded_again(bench):
    drag(bench, 0.2, 0.0)
    settled(bench)
    bench.pass_time(11.0)
    drag(bench, 0.2, 0.0)
    settled(bench)
    assert bench.sink.kinds == ["head.turn"] * 4


def test_turns_without_a_record_are_not_done(bench):
    bench.sink.fails = "disk full"
    answers = drag(bench, 0.2, 0.0)
    settled(bench)
    assert (bench.base.aims, codes(answers)) == ([], ["not_recorded"])


def test_the_head_turns_within_its_limits():
    head = Head(SOURCE)
    aim = head.turn(1.0, 0.5, None, 10.0)
    assert (aim.pan, aim.tilt) == (1.0, 0.5)
    aim = head.turn(1.0, 0.5, None, 10.2)
    assert (aim.pan, aim.tilt) == (SOURCE.pan_rad[1], SOURCE.tilt_rad[1])


def test_a_drag_starts_where_the_head_is_and_goes_on_from_there(bench):
    bench.base.head = (0.4, -0.3)  # a motion or another node moved it
    drag(bench, 0.2, 0.1)
    settled(bench)
    drag(bench, 0.1, 0.0)  # the head is still on its way
    assert [(aim.pan, aim.tilt) for aim in bench.base.aims] == [
        pytest.approx((0.6, -0.2)),
        pytest.approx((0.7, -0.2)),
    ]
    bench.pass_time(ARRIVED_S + 0.1)
    bench.base.head = (-0.5, 0.0)
    drag(bench, 0.1, 0.0)
    assert (bench.base.aims[-1].pan, bench.base.aims[-1].tilt) == pytest.approx((-0.4, 0.0))


def test_the_head_turns_to_absolute_angles_from_where_it_is(bench):
    bench.base.head = (0.4, -0.3)
    first = bench.ask(wire.TurnHead(1, 0.2, 0.1), 1)
    second = bench.ask(wire.TurnHead(1, 0.5, -0.2, absolute=True), 1)  # both wait for the record
    settled(bench)
    third = bench.ask(wire.TurnHead(1, -0.1, 0.0, absolute=True), 1)
    assert first == second == third == [None]
    assert [(aim.pan, aim.tilt) for aim in bench.base.aims] == [
        pytest.approx((0.5, -0.2)),
        pytest.approx((-0.1, 0.0)),
    ]
    assert bench.base.aims[0].seconds == pytest.approx(0.2), "0.1 rad from where it is"


@pytest.mark.parametrize("at", [(0.0, 0.0), None])
def test_many_turns_at_once_take_the_time_of_their_way(at):
    head = Head(SOURCE)
    head.turn(0.0, 0.0, at, 10.0)
    aims = [head.turn(0.1, 0.0, at, 11.9) for _ in range(10)]
    assert aims[-1].pan == pytest.approx(1.0)
    assert aims[-1].seconds >= 1.0 / TURN_RADPS - 1e-9
    back = head.turn(-0.1, 0.0, (0.9, 0.0), 13.0)
    assert back.seconds == pytest.approx(0.2), "it has nearly arrived"


def test_the_first_turn_of_a_head_of_unknown_place_is_slow():
    head = Head(SOURCE)
    assert head.turn(0.1, 0.0, None, 10.0).seconds > 2.0
    assert head.turn(0.1, 0.0, (1.1, 0.0), 20.0).seconds == pytest.approx(0.2)
    assert Head(SOURCE).turn(0.1, 0.0, (1.1, 0.0), 10.0).seconds == pytest.approx(0.2)


def test_a_turned_head_does_not_follow_the_drive_until_asked():
    head = Head(FOLLOWS)
    head.turn(0.5, 0.0, None, 9.0)
    assert head.follow(Velocity(0.5, 0.0, 0.8), 10.0) is None
    head.ahead(None, 11.0)
    assert head.follow(Velocity(0.5, 0.0, 0.8), 20.0) is not None


@pytest.mark.parametrize("spoil", [lambda bench: bench.core.stop("Bob", "", bench.now_s), others_play])
def test_a_drag_ends_with_the_right_to_it(bench, spoil):
    drag(bench, 0.2, 0.0)
    settled(bench)
    spoil(bench)
    aims = len(bench.base.aims)
    assert codes(drag(bench, 0.2, 0.0)) != [None]
    bench.pass_time(0.1)
    assert len(bench.base.aims) == aims


def test_a_driver_is_told_of_a_head_that_follows():
    bench = with_head(FOLLOWS)
    follows = lambda: bench.core.state(bench.now_s, []).head_follows  # noqa: E731
    assert not follows()
    bench.driving(0.5)
    turn(bench)
    assert follows()
    bench.core.revoke(1, "over", bench.now_s)
    bench.granted(2)
    assert not follows()


# --- the end of a turn ------------------------------------------------------------------------------------


def turning(bench, pan=0.6, tilt=0.0, seq=1, **fields):
    """Ask for a turn, whose record is written."""
    answers = bench.ask(wire.TurnHead(1, pan, tilt, seq, **fields), 1)
    settled(bench)
    assert answers == [None]


def head_ended(bench):
    ended = bench.core.state(bench.now_s, []).head_ended
    return (ended.seq, ended.fence, ended.outcome) if ended else None


def test_a_turn_ends_when_the_head_is_there(bench):
    bench.base.head = (0.0, 0.0)
    turning(bench)
    bench.pass_time(bench.base.aims[-1].seconds - 0.1)
    bench.base.head = (0.58, 0.01)
    bench.pass_time(0.05)
    assert head_ended(bench) is None, "it may still move"
    bench.pass_time(0.1)
    assert head_ended(bench) == (1, 1, "done")


def test_a_head_that_stops_on_its_way_has_not_arrived(bench):
    bench.base.head = (0.0, 0.0)
    turning(bench)
    for step in range(6):  # slower than it should be
        bench.base.head = (0.05 * step, 0.0)
        bench.pass_time(0.5)
    assert head_ended(bench) is None
    bench.pass_time(STILL_S)
    assert head_ended(bench) == (1, 1, "not_there")


def test_a_head_of_unknown_place_was_sent(bench):
    turning(bench)
    bench.pass_time(bench.base.aims[-1].seconds + 0.1)
    assert head_ended(bench) == (1, 1, "sent")


@pytest.mark.parametrize(
    ("said", "outcome"),
    [("succeeded", "done"), ("failed", "failed"), ("rejected", "rejected"), ("cancelled", "taken_over")],
)
def test_a_turn_ends_as_the_robots_action_says(bench, said, outcome):
    bench.base.head_goal = "own"
    turning(bench)
    head = bench.core.tasks.part(HeadTasks)
    head.ended("another node's", "failed", "")
    assert head_ended(bench) is None
    head.ended("own", said, "Words.")
    assert head_ended(bench) == (1, 1, outcome)


def test_an_action_that_says_nothing_is_given_up(bench):
    bench.base.head_goal = "own"
    turning(bench)
    bench.pass_time(bench.base.aims[-1].seconds + STILL_S - 0.1)
    assert head_ended(bench) is None
    bench.pass_time(0.2)
    assert head_ended(bench) == (1, 1, "unheard")


def test_another_turn_replaces_a_turn_and_zeros_from_here_stop_it(bench):
    bench.base.head = (0.0, 0.0)
    turning(bench)
    bench.base.head = (0.2, 0.0)
    turning(bench, 0.0, 0.0, seq=2, here=True)
    assert head_ended(bench) == (1, 1, "replaced")
    assert (bench.base.aims[-1].pan, bench.base.aims[-1].tilt) == (0.2, 0.0)
    bench.pass_time(1.0)
    assert head_ended(bench) == (2, 1, "done")
    turning(bench, seq=3)
    ask(bench)
    settled(bench)
    assert head_ended(bench) == (3, 1, "replaced")


@pytest.mark.parametrize(
    ("ends", "outcome"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "control_ended"),
        (unrecorded_for_a_while, "not_recorded"),
    ],
)
def test_a_turn_that_nobody_watches_any_more_ends(bench, ends, outcome):
    turning(bench)
    ends(bench)
    assert head_ended(bench) == (1, 1, outcome)


def test_pages_hear_at_once_how_a_drag_ended_and_not_of_each_turn(bench):
    bench.base.head = (0.0, 0.0)
    turning(bench)
    before = bench.core.tasks.headline(bench.now_s)
    turning(bench, 0.1, seq=2)
    assert bench.core.tasks.headline(bench.now_s) == before
    bench.base.head = (0.7, 0.0)
    bench.pass_time(2.0)
    assert bench.core.tasks.headline(bench.now_s) != before
