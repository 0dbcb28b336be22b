"""Fixtures of whole drives."""

from tests.simulator.conftest import robot_in as robot_in
