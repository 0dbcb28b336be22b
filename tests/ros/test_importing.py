"""ROS comes from the distribution's folder, and everything else from the environment."""

import os
import subprocess
import sys

import pytest

from robots.shared.ros import ros_folders

CHECK = (
    "import robots.bridge.ros, sys, daphne.server, rospy, rosbag, yaml; print(yaml.__file__, rospy.__file__)"
)


@pytest.mark.parametrize("shadow", ["zope", "yaml", "twisted"])
def test_a_package_of_the_distribution_shadows_none(tmp_path, shadow):
    # As Debian's python3-zope.interface: a package with __init__.py beside the environment's namespace package.
    (tmp_path / shadow).mkdir()
    (tmp_path / shadow / "__init__.py").write_text("raise RuntimeError('imported from the distribution')")
    environment = {**os.environ, "FLEET_ROS_PATH": os.pathsep.join([str(tmp_path), *ros_folders()])}
    run = subprocess.run(
        [sys.executable, "-c", CHECK], env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    of_environment, of_distribution = run.stdout.split()
    assert of_environment.startswith(sys.prefix)
    assert not of_distribution.startswith(sys.prefix)


LEAN = (
    "from robots.bridge.robot.lean import leave_out, lighten; lighten();"
    "from robots.bridge.ros import lean; lean.{lighten}(); leave_out('ssl');"
)
WATCHDOG = "import robots.bridge.watchdog.process, robots.bridge.ros.watchdog"
BRIDGE = "import robots.bridge.audit.remote_sink, robots.bridge.process, robots.bridge.ros.node"
NEITHER = [
    "django",
    "ssl",
    "_ssl",
    "_hashlib",
    "catkin_pkg",
    "bz2",
    "csv",
    "yaml.nodes",
    "xml.dom.domreg",
    "geometry_msgs.msg._Wrench",
]


@pytest.mark.parametrize(
    ("lighten", "program", "not_wanted"),
    [
        ("lighten_watchdog", WATCHDOG, [*NEITHER, "numpy", "asyncio", "robots.bridge.gate"]),
        ("lighten", BRIDGE, [*NEITHER, "cbor2"]),
    ],
    ids=["watchdog", "bridge"],
)
def test_a_process_of_each_robot_imports_little(lighten, program, not_wanted):
    show = f"; import sys; print(*[name for name in {not_wanted} if sys.modules.get(name)])"
    assert printed(program + show, lighten) == []


def test_left_out_messages_come_when_they_are_asked_for():
    ask = "import std_msgs.msg as kinds; print(kinds.String('here').data, hasattr(kinds, 'Nothing'))"
    assert printed(ask) == ["here", "False"]


def test_what_is_needed_seldom_comes_when_it_is_asked_for():
    ask = (
        "import importlib.metadata, yaml; from std_msgs.msg import String;"
        "print(str(String('here')), importlib.metadata.version('numpy'), yaml.safe_load('[1]'))"
    )
    assert printed(ask)[:2] == ["data:", '"here"']


def printed(program: str, lighten: str = "lighten") -> list[str]:
    run = subprocess.run(
        [sys.executable, "-c", LEAN.format(lighten=lighten) + program],
        capture_output=True,
        text=True,
        check=True,
    )
    return run.stdout.split()
