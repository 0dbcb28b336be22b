"""Raw tf messages: their transforms, also of messages that are cut."""

from __future__ import annotations

import io

import numpy as np
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from robots.bridge.robot.sensors.frames import TRANSFORM, FramePose
from robots.bridge.ros.sensors.tf import transforms


def stamped(parent, child, stamp_s, xyz=(0.0, 0.0, 0.0)):
    transform = TransformStamped()
    transform.header.stamp = rospy.Time.from_sec(stamp_s)
    transform.header.frame_id, transform.child_frame_id = parent, child
    transform.transform.translation, transform.transform.rotation = Vector3(*xyz), Quaternion(w=1.0)
    return transform


def raw(*several):
    written = io.BytesIO()
    TFMessage(list(several)).serialize(written)
    return written.getvalue()


def test_transforms_are_read_without_the_slash_of_old_publishers():
    found = transforms(raw(stamped("/base", "/head", 10.5, (1.0, 2.0, 3.0)), stamped("map", "door", 0.0)))
    assert [child for child, _ in found] == ["head", "door"]
    [(_, pose)] = transforms(raw(stamped("/base", "/head", 10.5, (1.0, 2.0, 3.0))))
    assert pose == FramePose(10.5, "base", TRANSFORM.pack(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0))


def test_messages_that_are_cut_or_nonsense_break_nothing():
    whole = raw(stamped("base", "head", 1.0), stamped("head", "camera", 1.0))
    for length in range(len(whole)):
        assert len(list(transforms(whole[:length]))) < 2
    random = np.random.default_rng(0)
    for length in (0, 3, 4, 16, 200, 2000):
        list(transforms(random.bytes(length)))
    assert list(transforms(b"\xff" * 100)) == []
