"""The console's configuration of this bench's TIAGo: its shipped profile, without a database."""

from __future__ import annotations

import os
from functools import cache

import django

from robots.registry.configuration.robot_config import Effective
from robots.shared.configuration.bridge_config import ArmSource, HeadSource
from robots.shared.configuration.gate_profile import GateProfile


def tiago_profile() -> GateProfile:
    """Return the gate's parameters of a TIAGo without settings of its own."""
    return _config().gate


def tiago_arm() -> ArmSource:
    arm = _config().topics.arm
    if arm is None:
        raise RuntimeError("the shipped profile of a TIAGo has no arm")
    return arm


def tiago_head() -> HeadSource:
    head = _config().topics.head
    if head is None:
        raise RuntimeError("the shipped profile of a TIAGo has no head")
    return head


@cache
def _config() -> Effective:
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "tests.settings")
    django.setup()
    from robots.registry.configuration import robot_config
    from robots.registry.models import Robot, RobotProfile
    from robots.registry.shipped_profiles import fill, profile_files

    profile = RobotProfile()
    fill(profile, next(file for file in profile_files() if file.slug == "tiago"))
    return robot_config.of(Robot(profile=profile))
