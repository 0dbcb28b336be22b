"""A simulator's life: begun, its master restarted, ended; it leaves nothing behind."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import signal
import subprocess
import sys

import rosgraph

from tests.ros.support import REPOSITORY, until


def topics_of(master, node: str) -> set[str]:
    """What `node` is registered for with a master that answers."""
    published, subscribed, _ = rosgraph.Master("/test", master.uri).getSystemState()
    return {topic for topic, nodes in (*published, *subscribed) if node in nodes}


def test_sigterm_ends_it_and_unregisters_it(make_master, simulator):
    master = make_master()
    robot = simulator(master=master)
    assert topics_of(master, robot.node)
    assert robot.stop() == 0
    assert topics_of(master, robot.node) == set()


def test_sigint_ends_it(make_master, simulator):
    robot = simulator(master=make_master())
    robot.process.send_signal(signal.SIGINT)
    assert robot.process.wait(5) == 0


def test_it_exits_with_its_parent(make_master, simulator):
    robot = simulator(master=make_master())
    robot.process.stdin.close()
    assert robot.process.wait(5) == 0


def test_it_comes_back_to_a_restarted_master(make_master, simulator):
    master = make_master()
    robot = simulator(master=master)
    before = topics_of(master, robot.node)
    master.kill()
    master.start()
    until(lambda: topics_of(master, robot.node) == before, "everything registered again", 5.0)
    assert robot.process.poll() is None
    until(
        lambda: rosgraph.Master("/test", master.uri).hasParam("/robot_description"), "parameters again", 5.0
    )


def test_it_waits_for_a_master_that_is_not_there_yet(make_master, simulator, tmp_path):
    master = make_master()
    master.kill()
    with open(tmp_path / "log", "wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "robots.simulator", "--name=early"],
            cwd=REPOSITORY,
            env=master.environment(),
            stderr=log,
        )
    until(lambda: "waiting for a master" in (tmp_path / "log").read_text(), "it waits")
    master.start()
    until(lambda: topics_of(master, "/simulator_early"), "it came")
    process.terminate()
    assert process.wait(5) == 0


def test_other_bases_speak_their_profiles_topics(make_master, simulator):
    master = make_master()
    omni = simulator(master=master, base="generic_omni")
    assert {"/cmd_vel", "/odom", "/scan"} <= topics_of(master, omni.node)
    assert "/tts/goal" not in topics_of(master, omni.node)


def test_a_wrong_world_is_said_in_one_line():
    ended = subprocess.run(
        [sys.executable, "-m", "robots.simulator", "--world=moon"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=20,
    )
    assert ended.returncode == 2
    assert "there is no world 'moon'" in ended.stderr
    assert "Traceback" not in ended.stderr
