"""A simulator starts, survives a restart of its master, and leaves no registration when it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rosgraph

from tests.processes import PATIENCE_S, REPOSITORY, end, until
from tests.ros.spoiled_master import CUT_SHORT, spoiling

HANGING_S = 3.0  # s, in which the simulator ends although the master hangs


def topics_of(master, node: str) -> set[str]:
    """Return the topics for which `node` is registered at a running master."""
    published, subscribed, _ = rosgraph.Master("/test", master.uri).getSystemState()
    return {topic for topic, nodes in (*published, *subscribed) if node in nodes}


@contextmanager
def early_bird(master, log: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A simulator that starts before its master answers."""
    with open(log, "wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "robots.simulator", "--name=early"],
            cwd=REPOSITORY,
            env=master.environment(),
            stderr=output,
        )
    try:
        yield process
    finally:
        end(process)


def test_sigterm_ends_it_and_unregisters_it(make_master, simulator):
    master = make_master()
    robot = simulator(master=master)
    assert topics_of(master, robot.node)
    assert robot.stop() == 0
    assert topics_of(master, robot.node) == set()


def test_sigint_ends_it(make_master, simulator):
    robot = simulator(master=make_master())
    robot.process.send_signal(signal.SIGINT)
    assert robot.process.wait(PATIENCE_S) == 0


def test_it_exits_with_its_parent(make_master, simulator):
    robot = simulator(master=make_master())
    robot.process.stdin.close()
    assert robot.process.wait(PATIENCE_S) == 0


def test_it_ends_although_its_master_hangs(make_master, simulator):
    master = make_master()
    robot = simulator(master=master)
    master.process.send_signal(signal.SIGSTOP)
    robot.process.terminate()
    assert robot.process.wait(HANGING_S) == 0
    master.kill()


def test_it_ends_although_its_master_hung_from_the_first(make_master, tmp_path):
    master = make_master()
    master.process.send_signal(signal.SIGSTOP)
    with early_bird(master, tmp_path / "log") as process:
        until(lambda: "does not answer" in (tmp_path / "log").read_text(), "it waits")
        process.terminate()
        assert process.wait(HANGING_S) == 0
    master.kill()


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


def test_it_rejoins_whole_after_a_half_answering_master(make_master, simulator):
    real = make_master()
    with spoiling(real) as master:
        robot = simulator(master=master)
        before = topics_of(real, robot.node)
        real.kill()
        master.spoiled["setParam"] = CUT_SHORT
        real.start()
        until(lambda: "setParam" in master.given, "an answer cut short", 5.0)
        assert topics_of(real, robot.node) == before
        master.spoiled.clear()
        until(
            lambda: rosgraph.Master("/test", real.uri).hasParam("/robot_description"),
            "parameters, too",
            5.0,
        )
        assert robot.stop() == 0


def test_it_waits_for_a_master_that_is_not_there_yet(make_master, simulator, tmp_path):
    master = make_master()
    master.kill()
    with early_bird(master, tmp_path / "log") as process:
        until(lambda: "waiting for a master" in (tmp_path / "log").read_text(), "it waits")
        master.start()
        until(lambda: topics_of(master, "/simulator_early"), "it came")
        process.terminate()
        assert process.wait(PATIENCE_S) == 0


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
