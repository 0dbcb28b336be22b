"""Worlds are loaded from data files."""

from __future__ import annotations

import pytest

from robots.simulator.joints.frames import frames, urdf
from robots.simulator.physics.mujoco_world import Physics, Pose
from robots.simulator.sensors.body import BODIES
from robots.simulator.worlds import load_world


@pytest.mark.parametrize("base", BODIES)
def test_the_office_can_be_entered_by_every_robot(base):
    world = load_world("office")
    for x, y, _ in world.starts:
        assert Physics(world, BODIES[base], Pose(x, y, 0.0)).clearance_m() > 0.1


def test_the_office_has_all_obstacles_for_the_gate():
    world = load_world("office")
    assert {table.legs for table in world.tables} == {True, False}
    assert world.chairs
    assert world.people
    gaps = sorted(
        (end[0], start[0])
        for wall, other in zip(world.walls, world.walls[1:], strict=False)
        for end, start in [(wall.end, other.start)]
        if wall.name.startswith("partition") and other.name.startswith("partition")
    )
    assert gaps[0][1] - gaps[0][0] == pytest.approx(0.8)


def test_an_unknown_world_is_named():
    with pytest.raises(ValueError, match="no world 'moon'"):
        load_world("moon")


def test_a_mistake_in_a_world_is_named(tmp_path):
    file = tmp_path / "bad.yaml"
    file.write_text("name: bad\nsize: [0, 0, 1, 1]\nwalls: [{name: w, from: [0, 0], too: [1, 0]}]\n")
    with pytest.raises(ValueError, match=r"bad\.yaml: .*too"):
        load_world(str(file))


@pytest.mark.parametrize("base", BODIES)
def test_every_frame_has_an_existing_parent(base):
    body = BODIES[base]
    known = {body.names.base_frame, "base_link"}
    for frame in frames(body):
        assert frame.parent in known
        known.add(frame.child)
    assert urdf(body, base).count("<joint ") >= len(frames(body))
