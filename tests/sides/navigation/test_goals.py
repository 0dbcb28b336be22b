"""Drives to a place by the robot's own navigation: their begins and their ends."""

from __future__ import annotations

import itertools
import math
import time

import pytest

from robots.shared import wire
from tests.processes import until
from tests.sides.navigation.traveller import FAR, pause, speed
from tests.sides.visitor import place

OUTSIDE, WALL = (60.0, 1.8), (2.0, 3.5)
PATH = "nav_msgs/Path"
POSE = "geometry_msgs/PoseWithCovarianceStamped"


def is_zero(twist) -> bool:
    return twist.linear.x == twist.linear.y == twist.angular.z == 0.0


def test_it_drives_to_a_place_and_shows_its_way(traveller, truth, twists):
    traveller.until(
        lambda state: state.location and not state.location.problem, "a robot that knows where it is"
    )
    pause(traveller, 0.5)
    seq = traveller.go_away((3.4, 1.8), (5.4, 1.8), heading=1.0)
    goal = traveller.goal
    path = traveller.hand.until(lambda report: isinstance(report, wire.GoPath) and report.path_cm, "the path")
    state = traveller.drives()
    assert state.going.left_m > 0.1 and state.going.who == "Ann"
    assert 4 <= len(path.path_cm) <= 2 * wire.MOST_PATH
    assert math.dist((path.path_cm[-2] / 100, path.path_cm[-1] / 100), goal) < 0.3
    twists.drain()
    pause(traveller, 0.5)
    assert not twists.drain()  # zeros of the bridge would override navigation
    end = traveller.ended(seq)
    assert (end.outcome, end.text, end.because) == ("arrived", "", None)
    x, y, heading = place(truth)
    assert math.dist((x, y), goal) < 0.25
    assert abs(math.remainder(heading - 1.0, math.tau)) < 0.3
    assert math.dist((x, y), (traveller.hand.state.location.x, traveller.hand.state.location.y)) < 0.3
    twists.until(is_zero)
    until(lambda: "go.end arrived" in traveller.process.recorded(), "the end on record")
    recorded = [line.split()[0] for line in traveller.process.recorded()]
    last = max(
        place for place, kind in enumerate(recorded) if kind == "go.start"
    )  # the first may have met a late map
    assert [kind for kind in recorded[last:] if kind != "map"][:3] == ["go.start", "drive.start", "go.end"]


def plan(count: int, y: float):
    """Return the poses of a path, 2.5 cm apart."""
    header = {"frame_id": "map"}
    return [
        {"header": header, "pose": {"position": {"x": 0.025 * number, "y": y}}} for number in range(count)
    ]


def shows(traveller, y: float) -> None:
    def shown(report) -> bool:
        return isinstance(report, wire.GoPath) and report.path_cm[1:2] == [round(100.0 * y)]

    traveller.hand.until(shown, "the path")


def test_a_long_path_is_shown(side, visitor, traveller):
    with visitor.speak(side.topics.navigation.plan, PATH, kept=True) as plans, traveller.renewing():
        traveller.go_away()
        traveller.drives()
        plans.publish(header={"frame_id": "map"}, poses=plan(5000, 7.0))
        shows(traveller, 7.0)


def test_the_last_of_paths_in_quick_succession_is_shown(side, visitor, traveller):
    with visitor.speak(side.topics.navigation.plan, PATH, kept=True) as plans, traveller.renewing():
        traveller.go_away()
        traveller.drives()
        for y in (1.0, 2.0, 3.0, 4.0):
            plans.publish(header={"frame_id": "map"}, poses=plan(10, y))
            time.sleep(0.1)
        shows(traveller, 4.0)


def test_a_cancel_makes_it_stand(traveller, twists):
    seq = traveller.go_away()
    traveller.drives()
    assert traveller.refused(*FAR).code == "going"
    assert traveller.hand.ask(wire.DriveBy(1, distance_m=1.0, seq=900)).code == "going"
    assert traveller.hand.ask(wire.SetPose(1, 2.0, 2.0, 0.0, seq=901)).code == "going"
    assert traveller.hand.ask(wire.GoCancel(1, seq=902)) is None
    assert traveller.ended(seq).outcome == "cancelled"
    twists.until(is_zero)
    traveller.stands()
    assert traveller.hand.ask(wire.GoCancel(1, seq=903)).code == "no_goal"


def test_a_stop_makes_it_stand(traveller):
    seq = traveller.go_away()
    traveller.drives()
    traveller.hand.send(wire.LinkStop("Bob"))
    end = traveller.ended(seq)
    assert (end.outcome, end.text) == ("stopped", "The robot was stopped by Bob.")
    state = traveller.until(lambda state: state.stop.state == "stopped", "standstill")
    assert traveller.refused(*FAR).code == "stopped"
    traveller.hand.send(wire.LinkClear("Bob", state.stop.number, 5))
    traveller.until(lambda state: state.stop.state == "clear", "a clear stop")


def test_the_stick_takes_over_at_once(traveller, twists):
    seq = traveller.go_away()
    traveller.drives()
    traveller.hand.stick(-0.2)
    twists.until(lambda twist: twist.linear.x < 0.0)
    assert traveller.ended(seq).outcome == "replaced"
    traveller.hand.stick(0.0)
    traveller.hand.let_go()
    traveller.stands()


def test_the_end_of_control_makes_it_stand(traveller, twists):
    traveller.go_away()
    traveller.drives()
    traveller.hand.send(wire.Revoke(1, "The slot is over."))
    end = traveller.hand.state_until(lambda state: state.going_ended, "the end").going_ended
    assert (end.outcome, end.text) == ("control_lost", "The slot is over.")
    twists.until(is_zero)
    traveller.hand.state_until(lambda state: speed(state) < 0.01, "a robot that stands")


def test_a_silent_holder_makes_it_stand(traveller):
    seq = traveller.go_away()
    traveller.drives()
    end = traveller.hand.state_until(
        lambda state: state.going_ended and state.going_ended.seq == seq, "the end"
    ).going_ended
    assert (end.outcome, end.because) == ("control_lost", "dead_man")


def test_a_lost_link_makes_it_stand(traveller, truth):
    traveller.go_away()
    traveller.drives()
    traveller.hand.close()
    until(lambda: "go.end control_lost" in traveller.process.recorded(), "the end on record")
    truth.drain()
    truth.until(lambda pose: abs(pose.twist.twist.linear.x) < 0.01)


def test_goals_that_make_no_sense_are_refused_in_words(traveller):
    def starts():
        return [line for line in traveller.process.recorded() if line.startswith("go.start")]

    until(lambda: traveller.refused(*OUTSIDE).code == "goal_outside", "the map")
    begun = starts()  # one start, if the goal had to wait for the map
    assert traveller.refused(*OUTSIDE).code == "goal_outside"
    assert traveller.refused(*WALL).code == "goal_in_obstacle"
    assert starts() == begun
    for x in ("NaN", "1e99", '"a"'):
        traveller.hand._socket.send(f'{{"t":"go","fence":1,"x":{x},"y":1.8,"heading":0,"seq":950}}')
        traveller.hand.until(
            lambda report: isinstance(report, wire.Refused) and report.refusal.rule == "wire", "a refusal"
        )
    assert speed(traveller.hand.state) < 0.01


def test_navigation_that_never_answers_is_given_up(traveller, fault):
    fault("navigation_silent")
    assert traveller.ended(traveller.go_away()).outcome == "unheard"


def test_navigation_that_goes_on_is_held(traveller, truth, twists, fault):
    fault("navigation_goes_on")
    seq = traveller.go_away()
    traveller.drives()
    assert traveller.hand.ask(wire.GoCancel(1, seq=902)) is None
    assert traveller.ended(seq).outcome == "cancelled"
    traveller.until(lambda state: state.navigation_held, "words about it")
    assert traveller.refused(*FAR).code == "navigation_goes_on"
    traveller.hand.send(wire.Revoke(1, "Enough."))
    traveller.hand.state_until(lambda state: state.fence is None and speed(state) < 0.01, "no control")
    before = place(truth)
    time.sleep(2.5)  # without a hold, zeros end sooner after the end of control
    twists.drain()
    assert is_zero(twists.next())
    assert math.dist(before[:2], place(truth)[:2]) < 0.02
    assert any(line.startswith("go.hold") for line in traveller.process.recorded())
    fault("none")
    traveller.hand.state_until(lambda state: not state.navigation_held, "the end of the hold")
    until(lambda: "go.hold released" in traveller.process.recorded(), "its end on record")


def test_navigation_that_pauses_and_drives_on_is_held_again(traveller, truth, fault):
    fault("navigation_pauses")
    seq = traveller.go_away()
    traveller.drives()
    assert traveller.hand.ask(wire.GoCancel(1, seq=902)) is None
    assert traveller.ended(seq).outcome == "cancelled"
    traveller.hand.send(wire.Revoke(1, "Enough."))
    traveller.hand.state_until(lambda state: state.fence is None and speed(state) < 0.01, "no control")
    before = place(truth)
    traveller.hand.state_until(lambda state: state.navigation_held, "words about it, after the pause")
    time.sleep(1.0)
    assert math.dist(before[:2], place(truth)[:2]) < 0.05
    fault("none")
    traveller.hand.state_until(lambda state: not state.navigation_held, "the end of the hold")


def test_localisation_that_dies_ends_it_and_refuses_the_next(traveller, fault):
    seq = traveller.go_away()
    traveller.drives()
    fault("localisation_dead")
    end = traveller.ended(seq)
    assert end.outcome in {"location_lost", "failed"}
    traveller.until(lambda state: state.location.problem, "the problem")
    assert traveller.refused(*FAR).code == "localisation_old"


def test_localisation_that_jumps_ends_it(traveller, fault):
    seq = traveller.go_away()
    traveller.drives()
    fault("localisation_jumps")
    end = traveller.ended(seq)
    assert (end.outcome, end.text) == ("location_jumped", "The robot’s place on its map jumped by 1.5 m.")
    traveller.stands()


def test_a_set_pose_reaches_the_robot_and_a_doubtful_one_refuses(visitor, traveller, truth):
    x, y, heading = place(truth)
    with visitor.listen("/initialpose", POSE) as poses:
        visitor.connected(poses)
        heard: list = []
        numbers = itertools.count(960)

        def told() -> bool:  # the first pose may be sent before this test's listener is connected
            traveller.renew()
            assert traveller.hand.ask(wire.SetPose(1, x + 0.2, y, heading, seq=next(numbers))) is None
            heard.extend(poses.drain())
            return bool(heard)

        until(told, "the pose on the robot’s topic")
        pose = heard[0].pose
        assert pose.pose.position.x == pytest.approx(x + 0.2)
    traveller.until(
        lambda state: state.location.sigma_m == pytest.approx(0.5), "the uncertainty of a set pose"
    )
    assert any(line.startswith("pose.set") for line in traveller.process.recorded())
    with visitor.speak("/amcl_pose", POSE, kept=True) as publisher:
        here = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}
        doubtful = {"pose": here, "covariance": [4.0] + [0.0] * 6 + [1.0] + [0.0] * 28}
        publisher.publish(header={"frame_id": "map"}, pose=doubtful)
        state = traveller.until(lambda state: state.location.sigma_m > 1.9, "a great uncertainty")
    assert (state.location.sigma_m, state.location.sigma_across_m) == (2.0, 1.0)
    pause(traveller, 3.0)
    assert traveller.refused(*FAR).code == "localisation_uncertain"


def test_others_goals_and_a_goal_of_others_meanwhile(side, visitor, traveller):
    seq = traveller.go_away()
    x, y = traveller.goal
    traveller.drives()
    navigation, field = side.topics.navigation, "target_pose" if side.number == 1 else "pose"
    target = {
        "header": {"frame_id": "map"},
        "pose": {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}},
    }
    others = visitor.goal(navigation.action, navigation.type, **{field: target})
    assert others.accepted()
    end = traveller.ended(seq)
    assert end.outcome == "intruder", end
    assert "Another program cancelled it." in end.text
    traveller.until(lambda state: speed(state) < 0.01, "a robot that stands: zeros have priority")
    assert traveller.refused(*FAR).code == "navigation_busy"
    visitor.cancel(navigation.action)
    assert others.ended()[0] == "canceled"
