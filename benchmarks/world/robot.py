"""The TIAGo of this bench, as the console knows it: its shipped profile, without a database."""

from __future__ import annotations

import os
from functools import cache

import django

from robots.bridge.gate.values import GateProfile


@cache
def tiago_profile() -> GateProfile:
    """Return the registry's configuration of a TIAGo without own entries."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "tests.settings")
    django.setup()
    from robots.registry import robot_config
    from robots.registry.models import Robot, RobotProfile
    from robots.registry.shipped import fill, profile_files

    profile = RobotProfile()
    fill(profile, next(file for file in profile_files() if file.slug == "tiago"))
    return robot_config.of(Robot(profile=profile)).gate
