"""Goals of the robot's actions as tasks of the chain. Pure.

A goal has the fields of its message in the robot's ROS. Fields that a task does not have, such as the velocities of a
trajectory, are not read: the bridge decides how a limb gets to its place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import msgspec
from msgspec import Struct

from robots.shared import wire
from robots.shared.configuration.bridge_config import (
    POINT_HEAD,
    POINT_HEAD_2,
    TRAJECTORY,
    TRAJECTORY_2,
    HeadSource,
    LimbSource,
    Topic,
    Topics,
)
from robots.shared.messages.type_names import is_ros2
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Limb, NotDone, Refusal, TaskRequest

FEEDBACK, RESULT = "feedback", "result"
FEEDBACK_2 = "_action/feedback"  # ROS 2 tells a result only to the node that sent the goal
_SUCCEEDED: dict[str, dict[str, Any]] = {
    "play_motion2_msgs/action/PlayMotion2": {"success": True, "error": ""},
    "tts_msgs/action/TTS": {"error_msg": ""},
    TRAJECTORY_2: {"error_code": 0, "error_string": ""},
}
HEAD_HEIGHT_M = 1.1  # of a robot without depth camera: `DepthSource.height_m` is the head's top

Make = Callable[[int, int], TaskRequest]  # a task by fence and number


class RobotAction(NamedTuple):
    """One action whose goals are tasks. `task` raises NotDone for a goal that no task can do."""

    type: str
    task: Callable[[Mapping[str, Any]], Make]
    cancel: Make
    is_sent: bool = True  # the bridge sends the task to this action, which has feedback and result

    @property
    def reports(self) -> Sequence[str]:
        """Topics below the action's name by which everybody hears of its goals."""
        if not self.is_sent:
            return ()
        return (FEEDBACK_2,) if is_ros2(self.type) else (FEEDBACK, RESULT)

    @property
    def succeeded(self) -> dict[str, Any]:
        """The result of a goal that succeeded, as far as that is known without the robot's own."""
        return dict(_SUCCEEDED.get(self.type, {}))


class _Words(Struct):
    text: str = ""
    lang_id: str = ""


class _Tts(Struct):
    rawtext: _Words = msgspec.field(default_factory=_Words)


class _Spoken(Struct):
    """Fields of tts_msgs/action/TTS and of communication_skills/action/Say, which has no `locale`."""

    input: str = ""
    locale: str = ""


class _PlayMotion(Struct):
    motion_name: str = ""


class _Header(Struct):
    frame_id: str = ""


class _Point(Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class _Quaternion(_Point):
    w: float = 0.0


class _Pose(Struct):
    position: _Point = msgspec.field(default_factory=_Point)
    orientation: _Quaternion = msgspec.field(default_factory=_Quaternion)


class _Placed(Struct):
    header: _Header = msgspec.field(default_factory=_Header)
    pose: _Pose = msgspec.field(default_factory=_Pose)
    point: _Point = msgspec.field(default_factory=_Point)


class _MoveBase(Struct):
    target_pose: _Placed = msgspec.field(default_factory=_Placed)


class _NavigateToPose(Struct):
    pose: _Placed = msgspec.field(default_factory=_Placed)


class _PointHead(Struct):
    target: _Placed = msgspec.field(default_factory=_Placed)


class _TrajectoryPoint(Struct):
    positions: list[float] = []


class _Trajectory(Struct):
    joint_names: list[str] = []
    points: list[_TrajectoryPoint] = []


class _FollowTrajectory(Struct):
    trajectory: _Trajectory = msgspec.field(default_factory=_Trajectory)


class _Command(Struct):
    position: float = 0.0


class _GripperCommand(Struct):
    command: _Command = msgspec.field(default_factory=_Command)


def actions_of(topics: Topics) -> dict[str, RobotAction]:
    """Return the actions of a robot whose goals are tasks, by name."""
    found: dict[str, RobotAction] = {}
    if topics.motions:
        found[topics.motions.name] = RobotAction(topics.motions.type, _motion, wire.PlayCancel)
    for speech in (topics.speech, *topics.speech.others) if topics.speech else ():
        if speech.is_action:
            found[speech.name] = _spoken(speech, topics)
    if navigation := topics.navigation:
        drive = _drive_2 if is_ros2(navigation.type) else _drive
        found[navigation.action] = RobotAction(
            navigation.type, partial(drive, navigation.frame), wire.GoCancel
        )
    for limb, source in topics.limbs.items():
        task = _gripper if source.is_command else _limb
        cancel = partial(_limb_cancel, limb)
        found[source.action] = RobotAction(source.type, partial(task, limb, source), cancel)
    if head := topics.head:
        height_m = topics.depth.height_m if topics.depth else HEAD_HEIGHT_M
        in_2 = is_ros2(topics.drive.type)
        controller = head.topic.removesuffix("/command").removesuffix("/joint_trajectory")
        found[f"{controller}/follow_joint_trajectory"] = RobotAction(
            TRAJECTORY_2 if in_2 else TRAJECTORY, partial(_head, head), _head_stays, is_sent=False
        )
        if head.point_head:
            kind, point = POINT_HEAD_2 if in_2 else POINT_HEAD, partial(_point_head, head, height_m)
            found[head.point_head] = RobotAction(kind, point, _head_stays)
    return found


def _spoken(action: Topic, topics: Topics) -> RobotAction:
    language = topics.languages[0] if topics.languages else "en"
    speech = _speech_2 if is_ros2(action.type) else _speech
    return RobotAction(action.type, partial(speech, language), wire.SayCancel)


def _motion(given: Mapping[str, Any]) -> Make:
    name = _read(given, _PlayMotion).motion_name
    return _made(lambda fence, seq: wire.Play(fence, name, seq))


def _speech(default: str, given: Mapping[str, Any]) -> Make:
    words = _read(given, _Tts).rawtext
    if not words.text:
        raise _refused(say("The console speaks the words of rawtext; this goal has none."))
    return _said(words.text, words.lang_id, default)


def _speech_2(default: str, given: Mapping[str, Any]) -> Make:
    spoken = _read(given, _Spoken)
    if not spoken.input:
        raise _refused(say("The console speaks the words of input; this goal has none."))
    return _said(spoken.input, spoken.locale, default)


def _said(text: str, locale: str, default: str) -> Make:
    language = locale.replace("_", "-") or default
    return _made(lambda fence, seq: wire.Say(fence, text, language, seq=seq))


def _drive(frame: str, given: Mapping[str, Any]) -> Make:
    return _driven(frame, _read(given, _MoveBase).target_pose)


def _drive_2(frame: str, given: Mapping[str, Any]) -> Make:
    return _driven(frame, _read(given, _NavigateToPose).pose)


def _driven(frame: str, target: _Placed) -> Make:
    _require_frame(target.header.frame_id, frame)
    at, turned = target.pose.position, target.pose.orientation
    sine, cosine = 2.0 * (turned.w * turned.z + turned.x * turned.y), 1.0 - 2.0 * (turned.y**2 + turned.z**2)
    if not math.isclose(math.hypot(turned.x, turned.y, turned.z, turned.w), 1.0, abs_tol=0.1):
        raise _refused(say("The orientation of a goal is a quaternion of length 1."))
    heading = math.atan2(sine, cosine)
    return _made(lambda fence, seq: wire.Go(fence, at.x, at.y, heading, seq))


def _limb(limb: Limb, source: LimbSource, given: Mapping[str, Any]) -> Make:
    to_m = sum(_last(given, source.joints))
    return _made(lambda fence, seq: wire.MoveLimb(fence, limb, to_m, seq))


def _gripper(limb: Limb, _source: LimbSource, given: Mapping[str, Any]) -> Make:
    to_m = _read(given, _GripperCommand).command.position
    return _made(lambda fence, seq: wire.MoveLimb(fence, limb, to_m, seq))


def _limb_cancel(limb: Limb, fence: int, seq: int) -> TaskRequest:
    return wire.LimbCancel(fence, limb, seq)


def _head(head: HeadSource, given: Mapping[str, Any]) -> Make:
    return _turned(head, *_last(given, [head.pan_joint, head.tilt_joint]))


def _point_head(head: HeadSource, height_m: float, given: Mapping[str, Any]) -> Make:
    """Turn to a point as seen from above the base's middle: the head's own place is known to the robot only."""
    target = _read(given, _PointHead).target
    _require_frame(target.header.frame_id, head.base_frame)
    at = target.point
    pan, tilt = math.atan2(at.y, at.x), math.atan2(at.z - height_m, math.hypot(at.x, at.y))
    return _turned(head, pan, tilt)


def _turned(head: HeadSource, pan: float, tilt: float) -> Make:
    """Turn as far as the head can."""
    pan, tilt = (
        min(max(angle, low), high) for angle, (low, high) in ((pan, head.pan_rad), (tilt, head.tilt_rad))
    )
    return _made(lambda fence, seq: wire.TurnHead(fence, pan, tilt, seq, absolute=True))


def _head_stays(fence: int, seq: int) -> TaskRequest:
    """Turn from where the head is by nothing, in place of the goal: that ends it."""
    return wire.TurnHead(fence, 0.0, 0.0, seq, here=True)


def _last(given: Mapping[str, Any], joints: list[str]) -> list[float]:
    """Return where a trajectory leaves these joints. Raises NotDone unless it moves these and no others."""
    trajectory = _read(given, _FollowTrajectory).trajectory
    places = (
        dict(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=False))
        if trajectory.points
        else {}
    )
    if set(places) != set(joints) or len(trajectory.joint_names) != len(joints):
        raise _refused(
            say("A trajectory here moves {joints}, and has one point or more.", joints=", ".join(joints))
        )
    return [places[joint] for joint in joints]


def _require_frame(given: str, frame: str) -> None:
    if given.lstrip("/") != frame:
        text = say("This goal has the frame {given}; it needs {frame}.", given=given or "“”", frame=frame)
        raise NotDone(Refusal("other_frame", text, "robot", {"frame": frame}))


S = TypeVar("S", bound=Struct)


def _read(given: Mapping[str, Any], kind: type[S]) -> S:
    """Read the fields of a goal. Raises NotDone."""
    try:
        return msgspec.convert(given, kind)
    except msgspec.ValidationError as error:
        raise _refused(say("The message does not fit: {error}", error=str(error))) from error


def _made(make: Make) -> Make:
    """Return `make` after a try: raises NotDone if the task's own limits forbid its values."""
    try:
        wire.link_request(wire.encode(make(1, 1)))
    except wire.WireError as error:
        raise NotDone(error.refusal) from error
    return make


def _refused(text: Sentence | str) -> NotDone:
    return NotDone(Refusal("invalid", text, "wire"))
