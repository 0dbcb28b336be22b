"""Goals of actions become tasks, and the ends of tasks statuses of actionlib."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from robots.registry.shipped_profiles import profile_files
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic, Topics
from robots.shared.wire import NotDone
from teleop.rosbridge.actions import ends
from teleop.rosbridge.actions.ends import end_of
from teleop.rosbridge.actions.translation import actions_of

TIAGO, TIAGO_2 = (
    msgspec.convert({**file.topics, "drive": file.drive}, Topics)
    for slug in ("tiago", "tiago-ros2")
    for file in profile_files()
    if file.slug == slug
)
ACTIONS, ACTIONS_2 = actions_of(TIAGO), actions_of(TIAGO_2)
TORSO, GRIPPER = "/torso_controller/follow_joint_trajectory", "/gripper_controller/follow_joint_trajectory"
HEAD, POINT = "/head_controller/follow_joint_trajectory", "/head_controller/point_head_action"


def trajectory(*points: dict[str, float]) -> dict[str, Any]:
    names = list(points[0])
    return {
        "trajectory": {
            "joint_names": names,
            "points": [
                {"positions": list(point.values()), "time_from_start": {"secs": 1}} for point in points
            ],
        }
    }


def place(x: float, y: float, yaw: float, frame: str = "map") -> dict[str, Any]:
    turned = {"x": 0, "y": 0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    pose = {"position": {"x": x, "y": y}, "orientation": turned}
    return {"target_pose": {"header": {"frame_id": frame}, "pose": pose}}


def point(x: float, y: float, z: float, frame: str = "base_footprint") -> dict[str, Any]:
    return {"target": {"header": {"frame_id": frame}, "point": {"x": x, "y": y, "z": z}}, "max_velocity": 1}


LEFT, RIGHT = "gripper_left_finger_joint", "gripper_right_finger_joint"


@pytest.mark.parametrize(
    ("action", "goal", "task"),
    [
        ("/play_motion", {"motion_name": "wave", "skip_planning": False}, wire.Play(7, "wave", 3)),
        ("/tts", {"rawtext": {"text": "Hi", "lang_id": "en_GB"}}, wire.Say(7, "Hi", "en-GB", seq=3)),
        ("/tts", {"rawtext": {"text": "Hi"}}, wire.Say(7, "Hi", "en-GB", seq=3)),
        ("/move_base", place(1, -2.5, 0.0), wire.Go(7, 1.0, -2.5, 0.0, 3)),
        ("/move_base", place(1, 2, 0.0, "/map"), wire.Go(7, 1.0, 2.0, 0.0, 3)),
        (TORSO, trajectory({"torso_lift_joint": 0.2}), wire.MoveLimb(7, "torso", 0.2, 3)),
        (
            TORSO,
            trajectory({"torso_lift_joint": 0}, {"torso_lift_joint": 0.1}),
            wire.MoveLimb(7, "torso", 0.1, 3),
        ),
        (GRIPPER, trajectory({RIGHT: 0.02, LEFT: 0.03}), wire.MoveLimb(7, "gripper", 0.05, 3)),
        (HEAD, trajectory({"head_1_joint": 0.5, "head_2_joint": -0.2}), wire.TurnHead(7, 0.5, -0.2, 3, True)),
        (POINT, point(1, 1, 1.1), wire.TurnHead(7, math.pi / 4, 0.0, 3, True)),
        (POINT, point(0, 1, 1.1), wire.TurnHead(7, 1.3, 0.0, 3, True)),
    ],
)
def test_a_goal_becomes_a_task(action, goal, task):
    assert ACTIONS[action].task(goal)(7, 3) == task


@pytest.mark.parametrize(
    ("action", "goal", "task"),
    [
        ("/play_motion2", {"motion_name": "wave", "skip_planning": False}, wire.Play(7, "wave", 3)),
        ("/tts_engine/tts", {"input": "Hi", "locale": "en_GB"}, wire.Say(7, "Hi", "en-GB", seq=3)),
        ("/tts_engine/tts", {"input": "Hi", "locale": "", "voice": ""}, wire.Say(7, "Hi", "en-GB", seq=3)),
        ("/say", {"input": "Hi", "person_id": ""}, wire.Say(7, "Hi", "en-GB", seq=3)),
        (
            "/navigate_to_pose",
            {"pose": place(1, -2.5, 0.0)["target_pose"], "behavior_tree": ""},
            wire.Go(7, 1.0, -2.5, 0.0, 3),
        ),
        (TORSO, trajectory({"torso_lift_joint": 0.2}), wire.MoveLimb(7, "torso", 0.2, 3)),
        (GRIPPER, trajectory({RIGHT: 0.02, LEFT: 0.03}), wire.MoveLimb(7, "gripper", 0.05, 3)),
        (HEAD, trajectory({"head_1_joint": 0.5, "head_2_joint": -0.2}), wire.TurnHead(7, 0.5, -0.2, 3, True)),
        (POINT, point(1, 1, 1.1), wire.TurnHead(7, math.pi / 4, 0.0, 3, True)),
    ],
)
def test_a_goal_of_ros_2_has_its_own_fields(action, goal, task):
    assert ACTIONS_2[action].task(goal)(7, 3) == task


def test_a_heading_is_the_turn_about_the_vertical_axis():
    task = ACTIONS["/move_base"].task(place(0, 0, -2.0))(1, 1)
    assert isinstance(task, wire.Go)
    assert task.heading == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("action", "goal", "code"),
    [
        ("/play_motion", {}, "invalid"),
        ("/play_motion", {"motion_name": 5}, "invalid"),
        ("/tts", {"text": {"section": "greeting"}}, "invalid"),
        ("/tts", {"rawtext": {"text": "Hi", "lang_id": "?"}}, "invalid"),
        ("/move_base", place(1, 2, 0.0, "odom"), "other_frame"),
        ("/move_base", place(1, 2, 0.0) | {"target_pose": {"header": {"frame_id": "map"}}}, "invalid"),
        ("/move_base", place(1e9, 2, 0.0), "invalid"),
        (TORSO, {}, "invalid"),
        (TORSO, trajectory({"torso_lift_joint": 0.2, "arm_1_joint": 1.0}), "invalid"),
        (TORSO, trajectory({"torso_lift_joint": 1e6}), "invalid"),
        (
            TORSO,
            {"trajectory": {"joint_names": ["torso_lift_joint"] * 2, "points": [{"positions": [1]}]}},
            "invalid",
        ),
        (HEAD, trajectory({"head_1_joint": 0.5}), "invalid"),
        (POINT, point(1, 0, 1, "xtion_optical_frame"), "other_frame"),
        ("/tts_engine/tts", {"rawtext": {"text": "Hi"}}, "invalid"),
        ("/navigate_to_pose", place(1, 2, 0.0), "other_frame"),
    ],
)
def test_a_goal_that_no_task_can_do_is_refused(action, goal, code):
    with pytest.raises(NotDone) as refused:
        (ACTIONS | ACTIONS_2)[action].task(goal)
    assert refused.value.refusal.code == code


def test_a_robot_has_the_actions_of_its_profile_only():
    bare = Topics(TIAGO.drive, TIAGO.odometry, speech=Topic("/say", "std_msgs/String"))
    assert actions_of(bare) == {}
    assert set(ACTIONS) == {"/play_motion", "/tts", "/move_base", TORSO, GRIPPER, HEAD, POINT}


@pytest.mark.parametrize("action", ACTIONS)
def test_each_task_has_a_cancel(action):
    cancel = ACTIONS[action].cancel(7, 3)
    assert wire.link_request(wire.encode(cancel)) == cancel
    assert cancel.fence == 7


def test_a_cancel_of_the_head_turns_it_to_where_it_is():
    assert ACTIONS[HEAD].cancel(7, 3) == wire.TurnHead(7, 0.0, 0.0, 3, here=True)


class Seen(msgspec.Struct):
    """The part of a state that tells ends."""

    motion_ended: wire.MotionEnd | None = None
    speech_ended: wire.SpeechEnd | None = None
    going_ended: wire.GoEnd | None = None
    limbs: dict[wire.Limb, wire.LimbState] = {}
    head_ended: wire.HeadEnd | None = None


PLAY, SAY, GO = wire.Play(7, "wave", 3), wire.Say(7, "Hi", "en", seq=3), wire.Go(7, 1.0, 2.0, 0.0, 3)
LIFT, LOOK = wire.MoveLimb(7, "torso", 0.2, 3), wire.TurnHead(7, 0.1, 0.1, 3, True)


def gone(outcome: str, seq: int = 3, fence: int = 7) -> Seen:
    return Seen(going_ended=wire.GoEnd(1, seq, fence, outcome, "", None, None))


def lifted(outcome: str, seq: int = 3) -> Seen:
    return Seen(limbs={"torso": wire.LimbState(0.1, ended=wire.LimbEnd(1, seq, 7, outcome, "words", 0.1))})


def looked(outcome: str, seq: int = 3, fence: int = 7) -> Seen:
    return Seen(head_ended=wire.HeadEnd(seq, fence, outcome, ""))


@pytest.mark.parametrize(
    ("request_", "before", "now", "status"),
    [
        (PLAY, Seen(), Seen(), None),
        (PLAY, Seen(), Seen(motion_ended=wire.MotionEnd(1, "wave", "succeeded", "")), ends.SUCCEEDED),
        (
            PLAY,
            Seen(motion_ended=wire.MotionEnd(1, "wave", "succeeded", "")),
            Seen(motion_ended=wire.MotionEnd(1, "wave", "succeeded", "")),
            None,
        ),
        (SAY, Seen(), Seen(speech_ended=wire.SpeechEnd(5, "done", "")), ends.SUCCEEDED),
        (SAY, Seen(), Seen(speech_ended=wire.SpeechEnd(5, "stopped", "")), ends.PREEMPTED),
        (GO, Seen(), gone("arrived"), ends.SUCCEEDED),
        (GO, Seen(), gone("held_back"), ends.ABORTED),
        (GO, Seen(), gone("rejected"), ends.REJECTED),
        (GO, Seen(), gone("arrived", seq=2), None),
        (GO, Seen(), gone("arrived", fence=6), None),
        (LIFT, Seen(), lifted("cancelled"), ends.PREEMPTED),
        (LIFT, Seen(), lifted("done", seq=4), None),
        (LIFT, Seen(), Seen(), None),
        (LOOK, Seen(), Seen(), None),
        (LOOK, Seen(), looked("done"), ends.SUCCEEDED),
        (LOOK, Seen(), looked("not_there"), ends.ABORTED),
        (LOOK, Seen(), looked("taken_over"), ends.PREEMPTED),
        (LOOK, Seen(), looked("rejected"), ends.REJECTED),
        (LOOK, Seen(), looked("done", seq=2), None),
        (LOOK, Seen(), looked("done", seq=4), ends.PREEMPTED),
        (LOOK, Seen(), looked("done", seq=4, fence=6), None),
    ],
)
def test_the_end_of_a_task_is_that_of_its_goal(request_, before, now, status):
    end = end_of(request_, before, now)
    assert (end.status if end else None) == status
