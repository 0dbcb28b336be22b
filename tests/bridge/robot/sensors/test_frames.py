"""Transforms give a camera's pose on the base at a stamp; a missing one is reported, too many are bounded."""

from __future__ import annotations

import math
import struct
import threading

import numpy as np
import pytest

from robots.bridge.robot.sensors.frames import (
    MOST_FIXED,
    MOST_MOVING,
    TRANSFORM,
    FramePose,
    Frames,
    PoseUnknown,
    _parts,
)


def stamped(parent, child, stamp_s, xyz=(0.0, 0.0, 0.0), yaw=0.0):
    packed = TRANSFORM.pack(*xyz, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return child, FramePose(stamp_s, parent, packed)


@pytest.fixture
def frames():
    """A camera 0.1 m ahead on a head that turns slowly, 1 m above the base, and unneeded frames."""
    frames = Frames("base")
    frames.take((stamped("head", "camera", 0.0, (0.1, 0.0, 0.0)), stamped("map", "door", 0.0)), fixed=True)
    for step in range(11):
        stamp_s = 10.0 + 0.02 * step
        frames.take(
            (
                stamped("odom", "base", stamp_s, (5.0 + step, 0.0, 0.0)),
                stamped("base", "head", stamp_s, (0.0, 0.0, 1.0), yaw=0.2 * (stamp_s - 10.0)),
            ),
            fixed=False,
        )
    return frames


def test_the_way_is_put_together_at_the_stamp(frames):
    for stamp_s in (10.0, 10.03, 10.1, 10.19):
        yaw = 0.2 * (stamp_s - 10.0)
        expected = (0.1 * math.cos(yaw), 0.1 * math.sin(yaw), 1.0)
        pose = frames.pose_at("camera", stamp_s, patience_s=0.0)
        np.testing.assert_allclose(pose[:3, 3], expected, atol=1e-4)
        assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(yaw, abs=1e-4)


def test_a_picture_waits_for_the_frames_of_its_stamp(frames):
    late = [stamped("base", "head", 10.24, (0.0, 0.0, 1.0), yaw=0.05)]
    timer = threading.Timer(0.05, frames.take, (late, False))
    timer.start()
    assert frames.pose_at("camera", 10.23, patience_s=5.0)[2, 3] == 1.0
    timer.join()


@pytest.mark.parametrize(
    ("frame", "stamp_s", "says"),
    [
        ("nose", 10.1, "tf has no pose of nose on base"),
        ("door", 10.1, "tf has no pose of map on base"),
        ("camera", 10.5, "tf’s pose of head came too late"),
        ("camera", 9.0, "tf has no pose of head for that time"),
    ],
)
def test_a_missing_transform_is_reported(frames, frame, stamp_s, says):
    with pytest.raises(PoseUnknown, match=says):
        frames.pose_at(frame, stamp_s, patience_s=0.01)


def test_while_the_head_turns_its_place_counts_for_nothing(frames):
    frames.take([stamped("base", "head", 10.22, yaw=0.24)], fixed=False)
    with pytest.raises(PoseUnknown, match="the head is turning"):
        frames.pose_at("camera", 10.21, patience_s=0.0)


def test_a_hole_is_not_bridged(frames):
    frames.take([stamped("base", "head", 11.2)], fixed=False)
    with pytest.raises(PoseUnknown, match=r"for 1\.0 s"):
        frames.pose_at("camera", 10.9, patience_s=0.0)


def test_a_clock_that_was_set_back_starts_again(frames):
    for stamp_s in (3.0, 3.1):
        frames.take([stamped("base", "head", stamp_s, (0.0, 0.0, 2.0))], fixed=False)
    assert frames.pose_at("camera", 3.05, patience_s=0.0)[2, 3] == 2.0


def test_frames_in_a_circle_are_no_way():
    frames = Frames("base")
    frames.take((stamped("a", "b", 0.0), stamped("b", "a", 0.0)), fixed=True)
    with pytest.raises(PoseUnknown):
        frames.pose_at("a", 1.0, patience_s=0.0)


@pytest.mark.parametrize("numbers", [(math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0)])
def test_numbers_that_are_none_place_nothing(numbers):
    frames = Frames("base")
    frames.take([stamped("base", "camera", 0.0, numbers)], fixed=True)
    with pytest.raises(PoseUnknown, match="invalid numbers"):
        frames.pose_at("camera", 1.0, patience_s=0.0)


@pytest.mark.parametrize(
    "turn",
    [(0.0, 0.0, 0.0, 0.0), (1e-9, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, math.inf)],
)
def test_a_rotation_that_is_none_places_nothing(turn):
    packed = struct.pack("<7d", 1.0, 2.0, 3.0, *turn)
    with pytest.raises(PoseUnknown, match="invalid numbers"):
        _parts(packed)


def test_a_rotation_of_another_length_is_made_one():
    _, turn = _parts(struct.pack("<7d", 1.0, 2.0, 3.0, 0.0, 0.0, 0.3, 0.4))
    assert turn == pytest.approx([0.0, 0.0, 0.6, 0.8])


def test_a_floor_frames_newest_pose_counts(frames):
    assert frames.flat("odom", "map") is None
    for x in (1.0, 2.0):
        frames.take([stamped("map", "odom", 10.0 + x, (x, -3.0, 0.5), yaw=2.5)], fixed=False)
    _, pose = frames.flat("odom", "map")
    assert pose == pytest.approx((2.0, -3.0, 2.5))
    assert frames.flat("odom", "world") is None


def test_a_frame_without_finite_numbers_has_no_place():
    frames = Frames("base")
    frames.take([stamped("map", "odom", 1.0, (math.nan, 0.0, 0.0))], fixed=False)
    assert frames.flat("odom", "map") is None


def test_endless_frames_drop_old_unneeded_ones():
    frames = Frames("base")
    tree = (stamped("base", "torso", 1.0), stamped("torso", "camera", 1.0))
    with pytest.raises(PoseUnknown):
        frames.pose_at("camera", 1.0, patience_s=0.0)  # this makes the frame wanted
    for transform in tree * 2:  # twice: the first round makes the parent known
        frames.take([transform], fixed=False)
        with pytest.raises(PoseUnknown):
            frames.pose_at("camera", 99.0, patience_s=0.0)
    for number in range(4 * MOST_MOVING):
        frames.take([stamped("base", f"flood_{number}", 1.0)], fixed=False)
    assert len(frames._moving) == MOST_MOVING
    assert frames.is_full
    assert frames.pose_at("camera", 1.0, patience_s=0.0).shape == (4, 4)


def test_endless_fixed_frames_leave_the_first_ones():
    frames = Frames("base")
    frames.take([stamped("base", "camera", 1.0)], fixed=True)
    for number in range(2 * MOST_FIXED):
        frames.take([stamped("base", f"flood_{number}", 1.0)], fixed=True)
    assert len(frames._fixed) == MOST_FIXED
    assert frames.pose_at("camera", 1.0, patience_s=0.0).shape == (4, 4)


def test_a_frame_with_a_long_name_is_not_kept():
    frames = Frames("base")
    frames.take([stamped("base", "n" * 1_000_000, 1.0)], fixed=False)
    assert not frames._moving
