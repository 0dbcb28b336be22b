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


WATCHDOG = (
    "from robots.bridge.watchdog.lean import leave_out; leave_out(); import robots.bridge.watchdog.process, sys;"
    " print(*[name for name in ('django', 'numpy', 'ssl', 'catkin_pkg', 'robots.bridge.gate', 'asyncio')"
    " if sys.modules.get(name)])"
)


def test_the_watchdog_imports_little():
    """One runs for each robot: numpy and its kin would double its memory."""
    run = subprocess.run([sys.executable, "-c", WATCHDOG], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
