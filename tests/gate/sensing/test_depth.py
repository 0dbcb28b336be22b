"""Depth pictures become obstacles without floor, robot and ceiling; table tops and walls are remembered."""

from __future__ import annotations

import math
from contextlib import nullcontext

import numpy as np
import pytest

from robots.bridge.gate.arm.discs import AT_HOME, UNKNOWN, Posture
from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.sensing.depth import (
    DepthImage,
    Lens,
    Picture,
    columns_of,
    picture_of_cloud,
    picture_of_image,
    seen_through,
)
from robots.bridge.gate.sensing.scan import Malformed
from robots.bridge.gate_trace import Recorder, replay
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import Pose, Velocity
from tests.gate.conftest import Feeder, tiago_profile
from tests.gate.depth_pictures import (
    FLOOR,
    FOV,
    HEIGHT,
    HOME_M,
    LENS,
    LOOK_AHEAD,
    TABLE,
    VIEW,
    WALL,
    WIDTH,
    Looker,
    camera,
    cloud_of,
    drawn,
    image,
    nearest,
    obstacles,
    picture,
)

# --- messages ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["32FC1", "16UC1"])
@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("padding", [0, 12])
def test_every_way_to_write_a_picture_shows_the_same(encoding, big_endian, padding):
    depth = drawn([FLOOR, TABLE, WALL], camera())
    shown = picture_of_image(image(depth, encoding, big_endian, padding), LENS)
    np.testing.assert_allclose(shown.ahead, depth[2::4, 2::4], atol=0.001)


def test_unmeasured_is_unknown_and_infinity_is_free():
    depth = np.full((HEIGHT, WIDTH), 2.0, dtype=np.float32)
    depth[:120], depth[120:240], depth[240:360] = np.nan, 0.0, np.inf
    shown = picture_of_image(image(depth), LENS).ahead
    assert np.isnan(shown[:60]).all()
    assert np.isposinf(shown[60:90]).all()
    assert (shown[90:] == 2.0).all()


@pytest.mark.parametrize("organised", [True, False])
@pytest.mark.parametrize("big_endian", [False, True])
def test_a_cloud_shows_the_same_as_a_picture(organised, big_endian):
    to_base = camera(tilt=-0.3)
    shown = picture([FLOOR, TABLE, WALL], to_base)
    points = picture_of_cloud(cloud_of(shown, big_endian, organised), FOV)
    by_cloud, by_image = (columns_of(each, to_base, 1.3) for each in (points, shown))
    assert nearest(by_cloud) == pytest.approx(nearest(by_image), abs=0.03)
    assert len(by_cloud.points) == pytest.approx(len(by_image.points), rel=0.15)


@pytest.mark.parametrize(
    "changes",
    [
        {"encoding": "rgb8"},
        {"encoding": ""},
        {"width": 0},
        {"width": 2},
        {"height": -3},
        {"width": 2**31},
        {"height": 100_000},
        {"step": 4},
        {"step": 2**31},
        {"data": b""},
        {"data": b"short"},
        {"height": 481},
    ],
)
def test_a_picture_that_cannot_be_one_is_refused(changes):
    with pytest.raises(Malformed):
        picture_of_image(image(np.ones((HEIGHT, WIDTH), dtype=np.float32))._replace(**changes), LENS)


@pytest.mark.parametrize(
    "changes",
    [
        {"width": 0},
        {"width": 2**31, "height": 2**31},
        {"point_step": 0},
        {"point_step": 8},
        {"row_step": 1},
        {"row_step": 2**31},
        {"offsets": {"x": 0, "y": 4}},
        {"offsets": {"x": -4, "y": 4, "z": 8}},
        {"data": b""},
    ],
)
def test_a_cloud_that_cannot_be_one_is_refused(changes):
    with pytest.raises(Malformed):
        picture_of_cloud(cloud_of(picture([WALL], camera()))._replace(**changes), FOV)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -1.0, 1e38, 1e-38])
def test_pictures_of_nonsense_show_no_obstacle(value):
    shown = picture_of_image(image(np.full((HEIGHT, WIDTH), value, dtype=np.float32)), LENS)
    assert not len(columns_of(shown, camera(), 1.3).points)


def test_random_bytes_break_nothing():
    random = np.random.default_rng(1)
    for encoding in ("32FC1", "16UC1"):
        size = 4 if encoding == "32FC1" else 2
        noise = DepthImage(64, 48, encoding, False, 64 * size, random.bytes(64 * 48 * size))
        shown = picture_of_image(noise, Lens.seeing(FOV, 64, 48))
        found = columns_of(shown, camera(), 1.3)
        assert np.isfinite(found.points).all()


def test_small_and_large_pictures_show_the_wall():
    for width, height in ((8, 6), (320, 240), (1280, 720)):
        shown = picture_of_image(
            image(np.full((height, width), 2.0, dtype=np.float32)), Lens.seeing(FOV, width, height)
        )
        assert shown.ahead.shape[1] < 320
        if width > 8:
            assert nearest(columns_of(shown, camera(), 1.3)) == pytest.approx(2.175, abs=0.01)


# --- floor, ceiling, noise ---------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [0.0, -0.3, LOOK_AHEAD, -1.0])
@pytest.mark.parametrize("pan", [-0.6, 0.0, 0.6])
@pytest.mark.parametrize("height_m", [1.067, HOME_M, 1.417])
def test_a_floor_is_no_obstacle_however_the_head_stands(tilt, pan, height_m):
    assert not len(obstacles([FLOOR], camera(tilt, pan, height_m), noise=0.0015).points)


def test_a_floor_is_no_obstacle_when_the_tilt_is_a_degree_off():
    seen = picture([FLOOR], camera(LOOK_AHEAD), noise=0.0015)
    wrong = camera(LOOK_AHEAD + math.radians(1.3))
    assert not len(columns_of(seen, wrong, 1.3).points)


@pytest.mark.parametrize("height_m", [1.067, HOME_M, 1.417])
@pytest.mark.parametrize("noise", [0.0, 0.0015])
def test_the_edge_of_a_table_top_is_where_it_is(height_m, noise):
    found = obstacles([FLOOR, TABLE], camera(-0.3, height_m=height_m), noise=noise)
    assert nearest(found) == pytest.approx(1.6, abs=0.03)
    assert found.points[:, 1].min() == pytest.approx(-0.8, abs=0.05)
    assert found.points[:, 1].max() == pytest.approx(0.8, abs=0.05)


def test_only_the_rim_of_a_table_top_is_kept():
    found = obstacles([FLOOR, TABLE], camera(-0.3))
    inside = (abs(found.points[:, 1]) < 0.6) & (abs(found.points[:, 0] - 1.85) < 0.15)
    assert not inside.any()
    assert len(found.points) < 300, "a table top of 1.0 m x 1.6 m has 640 cells"


@pytest.mark.parametrize("pan", [-0.5, 0.5])
def test_a_wall_is_where_it_is_with_the_head_turned(pan):
    found = obstacles([FLOOR, WALL], camera(-0.1, pan), noise=0.0015)
    assert np.median(found.points[:, 0]) == pytest.approx(3.0, abs=0.05)


def test_a_seat_and_a_parcel_stand_above_the_floor():
    seat, parcel = ((1.4, -0.2, 0.41), (1.8, 0.2, 0.45)), ((1.5, 0.5, 0.0), (1.7, 0.7, 0.12))
    found = obstacles([FLOOR, seat, parcel], camera(LOOK_AHEAD), noise=0.0015)
    assert (found.points[:, 1] < 0.3).any()
    assert (found.points[:, 1] > 0.4).any()


def test_the_robot_passes_below_high_things_only():
    lamp = ((1.5, -0.2, 1.35), (1.9, 0.2, 1.6))
    assert not len(obstacles([FLOOR, lamp], camera()).points)
    shelf = ((1.5, -0.2, 1.20), (1.9, 0.2, 1.6))
    assert len(obstacles([FLOOR, shelf], camera()).points)
    assert len(obstacles([FLOOR, lamp], camera(height_m=1.417)).points), "the torso is up"
    level = ((1.5, -0.2, HOME_M + 0.03), (1.9, 0.2, 1.6))
    assert len(obstacles([FLOOR, level], camera(0.2)).points), "the head is higher than its camera"


def test_two_hits_are_noise_and_three_are_not():
    pixel = np.full((HEIGHT, WIDTH), np.nan, dtype=np.float32)
    pixel[242, 322] = pixel[242, 326] = 1.0
    assert not len(columns_of(picture_of_image(image(pixel), LENS), camera(), 1.3).points)
    pixel[246, 322] = 1.0
    assert len(columns_of(picture_of_image(image(pixel), LENS), camera(), 1.3).points) == 1


# --- evidence ----------------------------------------------------------------------------------------


def test_a_picture_sees_through_where_a_table_was_taken_away():
    found = obstacles([FLOOR, TABLE, WALL], camera(-0.3))
    table = found.points[:, 0] < 2.8
    gone = seen_through(picture([FLOOR, WALL], camera(-0.3), noise=0.0015), camera(-0.3), found)
    assert gone[table].mean() > 0.9
    assert not gone[~table].any()


def test_present_obstacles_are_not_seen_through():
    found = obstacles([FLOOR, TABLE, WALL], camera(-0.3))
    for seed in range(5):
        later = picture([FLOOR, TABLE, WALL], camera(-0.3), noise=0.0015, seed=seed)
        assert not seen_through(later, camera(-0.3), found).any()


def test_a_thing_gone_below_stays_above():
    """The thing may be a chair's back: the camera must see each height with a remembered point free."""
    back, seat = ((1.5, -0.3, 0.3), (1.55, 0.3, 0.9)), ((1.5, -0.3, 0.3), (1.55, 0.3, 0.5))
    upper, middle = ((1.5, -0.3, 0.5), (1.55, 0.3, 0.9)), ((1.5, -0.3, 0.45), (1.55, 0.3, 0.75))
    found = obstacles([FLOOR, back, WALL], camera(-0.3))
    chair = found.points[:, 0] < 2.0
    for left in (seat, upper, middle):
        later = picture([FLOOR, left, WALL], camera(-0.3), noise=0.0015)
        assert not seen_through(later, camera(-0.3), found)[chair].any()


def test_nothing_is_seen_through_out_of_view_or_behind_something():
    found = obstacles([FLOOR, TABLE], camera(-0.3))
    screen = ((1.0, -3.0, 0.0), (1.1, 3.0, 2.0))
    hall = [
        FLOOR,
        ((-6.0, -6.0, 0.0), (-5.9, 6.0, 4.0)),
        ((-6.0, 5.9, 0.0), (6.0, 6.0, 4.0)),
        ((-6.0, -6.0, 3.9), (6.0, 6.0, 4.0)),
    ]
    nothing = Picture(
        *(np.full_like(part, np.nan) if part.ndim == 2 else part for part in picture([FLOOR], camera(-0.3)))
    )
    for shown, to_base in (
        (picture([FLOOR], camera(0.0, pan=1.3)), camera(0.0, pan=1.3)),
        (picture(hall, camera(0.0, pan=1.3)), camera(0.0, pan=1.3)),
        (picture(hall, camera(0.6, pan=3.0)), camera(0.6, pan=3.0)),
        (picture([FLOOR], camera(0.6)), camera(0.6)),
        (picture([FLOOR, screen], camera(-0.3)), camera(-0.3)),
        (nothing, camera(-0.3)),
    ):
        assert not seen_through(shown, to_base, found).any()


# --- the camera on the robot -------------------------------------------------------------------------


@pytest.fixture
def looker():
    looker = Looker([FLOOR, TABLE])
    looker.stand(0.2)
    return looker


def test_a_table_top_stops_the_robot_at_its_edge(looker):
    for step in range(240):
        looker.now_s += 0.05
        looker.all()
        if step % 2:
            looker.look()
        verdict = looker.decide(1.0)
        looker.velocity = Velocity(verdict.velocity.vx, 0.0, 0.0)
        looker.pose = Pose(looker.pose.x + 0.05 * verdict.velocity.vx, 0.0, 0.0)
    gap = 1.6 - looker.pose.x - 0.27
    assert 0.0 < gap < 0.2
    assert verdict.velocity.vx == 0.0
    assert verdict.code == "obstacle"
    assert verdict.text.startswith("stopped (1.0 m/s asked): depth")
    assert verdict.side == "ahead"


def test_with_a_clear_view_speed_is_free(looker):
    looker.boxes = [FLOOR]
    looker.stand(0.5)
    verdict = looker.decide(1.0)
    assert verdict.velocity.vx == 1.0
    assert verdict.limits == () or not any("depth" in limit.text for limit in verdict.limits)


def test_a_removed_table_is_forgotten_after_two_pictures(looker):
    assert looker.nearest_by("depth") == pytest.approx(1.6, abs=0.03)
    looker.boxes = [FLOOR]
    looker.stand(0.1)
    assert looker.nearest_by("depth") == math.inf
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.6, abs=0.06)
    looker.stand(0.6)
    assert looker.nearest_by("depth, remembered") > 2.0, "but for what lies deep in the shade of the noise"


def test_points_out_of_the_picture_stay_while_the_head_turns(looker):
    looker.to_base = camera(pan=1.2)
    looker.stand(10.0)
    assert looker.nearest_by("depth") == math.inf
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.6, abs=0.05)
    looker.now_s += 120.0
    looker.stand(1.0)
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.6, abs=0.05), "it stands: nothing fades"
    looker.to_base = camera(tilt=0.9)
    for step in range(220):
        looker.pose = Pose(0.0, 0.0, 0.03 * (step % 2))
        looker.stand(0.1)
    assert looker.nearest_by("depth, remembered") == math.inf


AT_ITS_FEET = -1.025  # as far down as TIAGo's head goes


def at_a_desk(aside_m=0.0):
    """A robot that has driven up to a desk without legs; then its head looked aside, and the desk was taken away."""
    looker = Looker([FLOOR, ((1.6, -0.8 + aside_m, 0.70), (2.6, 0.8 + aside_m, 0.74))])
    looker.to_base = camera(LOOK_AHEAD)
    for x in np.arange(0.0, 1.231, 0.03):
        looker.pose = Pose(float(x), 0.0, 0.0)
        looker.stand(0.1)
    looker.to_base = camera(LOOK_AHEAD, pan=1.2)
    looker.to_base[:2, 3] = 0.025 + 0.15 * math.cos(1.2), 0.15 * math.sin(1.2)  # turned with the head
    looker.stand(0.3)
    looker.boxes = [FLOOR]
    looker.stand(0.3)
    return looker


def test_a_desk_that_has_gone_is_free_when_the_head_looks_down():
    looker = at_a_desk()
    looker.to_base = camera(LOOK_AHEAD)
    looker.stand(3.0)
    assert looker.nearest_by("depth, remembered") == pytest.approx(0.37, abs=0.05), "below the picture"
    assert looker.decide(0.5).velocity.vx < 0.1
    looker.to_base = camera(AT_ITS_FEET)
    looker.stand(0.5)
    assert looker.nearest_by("depth, remembered") > 0.5
    assert looker.decide(0.5).velocity.vx == pytest.approx(0.3), "the head looks away from the way ahead"


def test_a_desk_that_still_stands_stays_when_the_head_looks_down():
    looker = at_a_desk()
    looker.boxes = [FLOOR, TABLE]
    looker.to_base = camera(AT_ITS_FEET)
    looker.stand(3.0)
    assert min(looker.nearest_by("depth"), looker.nearest_by("depth, remembered")) < 0.42
    assert looker.decide(0.5).velocity.vx < 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_head_is_turned_to_the_nearest_place_that_is_remembered(side):
    looker = at_a_desk(aside_m=side * 0.95)  # its edge begins 0.15 m beside the middle of the way
    turn = looker.gate.look_to(looker.now_s)
    assert math.copysign(1.0, turn) == side
    assert 0.3 < abs(turn) < 1.4
    looker.gate.forget()
    assert looker.gate.look_to(looker.now_s) is None


def test_the_head_need_not_turn_to_what_is_ahead_or_far_or_unknown(looker):
    assert at_a_desk().gate.look_to(0.0) is None, "in the middle of the picture"
    assert looker.gate.look_to(looker.now_s) is None, "1.6 m ahead"
    assert Feeder(tiago_profile(has_depth=False)).gate.look_to(0.0) is None


def test_with_a_silent_camera_only_memory_remains(looker):
    looker.stand(0.6, looks=False)
    assert looker.nearest_by("depth") == math.inf
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.6, abs=0.05)


def test_nothing_fades_while_the_odometry_only_trembles(looker):
    looker.boxes = [FLOOR]
    looker.to_base = camera(LOOK_AHEAD, pan=1.2)
    for n in range(450):
        looker.pose = Pose(0.002 * (n % 2), 0.0, 0.0)
        looker.stand(0.1)
    looker.stand(60.0, looks=False)
    looker.pose = Pose(0.1, 0.0, 0.0)
    looker.stand(0.2)
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.5, abs=0.05)


def test_remembered_points_move_with_the_robot(looker):
    looker.pose = Pose(0.5, 0.0, 0.0)
    looker.to_base = camera(pan=1.2)
    looker.now_s += 0.6
    looker.all()
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.1, abs=0.05)


def test_a_jump_of_odometry_clears_the_memory(looker):
    looker.pose = Pose(1.5, 0.3, 0.0)
    looker.stand(0.1, looks=False)
    assert looker.nearest_by("depth") == looker.nearest_by("depth, remembered") == math.inf


def test_the_robots_own_arm_is_no_obstacle():
    gripper = ((0.20, -0.1, 0.8), (0.31, 0.1, 0.9))
    looker = Looker([FLOOR, gripper])
    looker.to_base = camera(-0.9)
    looker.stand(0.3)
    assert looker.nearest_by("depth") == math.inf
    assert looker.nearest_by("depth, remembered") == math.inf
    looker = Looker([FLOOR, gripper], own_m=0.0)
    looker.to_base = camera(-0.9)
    looker.stand(0.3)
    assert looker.nearest_by("depth") < 0.35, "the camera does see it"


def test_points_in_a_moving_arms_reach_are_not_remembered():
    """Once a hand that the description lacks stayed in the picture after `wave`: it held the robot for ever."""
    hand, shelf = ((0.55, -0.1, 0.7), (0.65, 0.1, 0.8)), ((1.3, -0.6, 0.2), (1.7, 0.6, 0.3))
    looker = Looker([FLOOR, hand, shelf], has_arm=True)
    looker.to_base = camera(-0.9)
    moves = Posture(at_home=False, discs=((0.2, 0.0, 0.1),), reach=(0.1, 0.0, 0.9))
    for arm in (None, UNKNOWN, moves):
        if arm is not None:
            looker.gate.observe_posture(arm, looker.now_s)
        looker.stand(0.4)
        assert looker.nearest_by("depth") == pytest.approx(0.55, abs=0.1)
    looker.boxes = [FLOOR]
    looker.gate.observe_posture(AT_HOME, looker.now_s)
    looker.to_base = camera(LOOK_AHEAD, pan=1.2)  # the hand's place is out of view now
    looker.stand(0.3)
    assert looker.nearest_by("depth, remembered") == pytest.approx(1.3, abs=0.05), (
        "the hand is gone, the shelf is not"
    )


def test_points_seen_after_the_arm_rests_are_remembered():
    looker = Looker([FLOOR, ((0.55, -0.1, 0.7), (0.65, 0.1, 0.8))], has_arm=True)
    looker.to_base = camera(-0.9)
    looker.gate.observe_posture(UNKNOWN._replace(reach=(0.1, 0.0, 0.9)), looker.now_s)
    for _ in range(15):
        looker.gate.observe_posture(AT_HOME, looker.now_s)
        looker.stand(0.1)
    looker.to_base = camera(LOOK_AHEAD, pan=1.2)
    looker.stand(0.1)
    assert looker.nearest_by("depth, remembered") == pytest.approx(0.55, abs=0.1)


def test_the_camera_sees_the_robot_around_the_arms_ends():
    looker = Looker([FLOOR, ((0.55, -0.1, 0.7), (0.65, 0.1, 0.8))], has_arm=True)
    looker.to_base = camera(-0.9)
    arm = Posture(at_home=False, discs=((0.45, 0.0, 0.09),), ends=((0.45, 0.0, 0.32),))
    looker.gate.observe_posture(arm, looker.now_s)
    looker.stand(0.3)
    assert looker.nearest_by("depth") == math.inf
    assert looker.gate.footprint.reach(0.0) == pytest.approx(0.54), "the hull is the arm alone"


# --- speed limits by the camera's view ---------------------------------------------------------------


def test_until_the_first_picture_speed_is_the_blind_one():
    looker = Looker([FLOOR])
    looker.stand(0.2, looks=False)
    verdict = looker.decide(1.0)
    assert verdict.velocity.vx == pytest.approx(0.3)
    assert (verdict.code, verdict.text) == (
        "depth_missing",
        "at most 0.3 m/s: no picture of the depth camera has come yet",
    )
    assert not looker.sensor().ok


def test_a_silent_camera_means_blind_speed_after_half_a_second():
    looker = Looker([FLOOR])
    looker.stand(0.2)
    looker.stand(0.5, looks=False)
    assert looker.decide(1.0).velocity.vx == 1.0
    looker.stand(0.1, looks=False)
    verdict = looker.decide(1.0)
    assert (verdict.velocity.vx, verdict.code) == (pytest.approx(0.3), "depth_stale")
    assert verdict.text == "at most 0.3 m/s: the depth camera’s picture is 0.6 s old"
    assert looker.back(-0.2).velocity.vx == pytest.approx(-0.2)
    assert looker.sensor().text == "nothing new for 0.6 s"


@pytest.mark.parametrize("value", [math.nan, math.inf, 0.0, 0.1, 60.0])
def test_pictures_without_floor_and_things_prove_nothing(value):
    with pytest.raises(Malformed, match="neither the floor nor objects on it"):
        frame_of(picture_of_image(image(np.full((HEIGHT, WIDTH), value)), LENS), camera(), VIEW)


@pytest.mark.parametrize(("shown_share", "usable"), [(0.4, True), (0.2, False)])
def test_a_third_of_a_dark_floor_is_enough(shown_share, usable):
    depth = drawn([FLOOR], camera(-0.3))
    depth[np.random.default_rng(3).random(depth.shape) > shown_share] = math.nan
    with nullcontext() if usable else pytest.raises(Malformed):
        frame_of(picture_of_image(image(depth), LENS), camera(-0.3), VIEW)


def test_a_wall_before_the_floor_is_shown_also_if_it_fills_all():
    for wall in (WALL, ((0.8, -5.0, 0.0), (0.9, 5.0, 2.5))):
        frame_of(picture([FLOOR, wall], camera(-0.3)), camera(-0.3), VIEW)


def test_a_camera_that_is_not_where_tf_says_shows_no_floor():
    with pytest.raises(Malformed):
        frame_of(picture([FLOOR], camera(-0.3)), camera(-0.6), VIEW)


def test_a_camera_that_looks_up_is_not_judged_by_its_floor():
    frame_of(picture([FLOOR], camera(0.5)), camera(0.5), VIEW)


@pytest.mark.parametrize("wrong", [{"fx": 0.0}, {"fy": -1.0}, {"cx": math.nan}, {"cy": math.inf}])
def test_a_lens_that_makes_no_sense_shows_nothing(wrong):
    with pytest.raises(Malformed, match="calibration"):
        picture_of_image(image(drawn([FLOOR], camera())), LENS._replace(**wrong))


def test_frozen_stamps_are_no_pictures():
    looker = Looker([FLOOR])
    looker.stand(0.2)
    frozen_s = looker.stamp_s
    frame = frame_of(picture([FLOOR], camera()), camera(), VIEW)
    for _ in range(8):
        looker.now_s += 0.1
        looker.all()
        looker.gate.observe_depth(frame, frozen_s, looker.now_s)
    assert looker.decide(1.0).code == "depth_stale"


def test_pictures_that_the_odometry_cannot_place_do_not_count():
    looker = Looker([FLOOR])
    looker.all()
    frame = frame_of(picture([FLOOR], camera()), camera(), VIEW)
    for stamp_s in (looker.stamp_s - 3600.0, math.nan):
        looker.gate.observe_depth(frame, stamp_s, looker.now_s)
    assert looker.decide(1.0).code == "depth_missing"
    assert looker.sensor().text == "its stamps do not match the odometry’s"
    looker.gate.observe_bad_depth("its pictures are 'rgb8'")
    assert looker.sensor().text == "its pictures are 'rgb8'"
    why = "at most 0.3 m/s: no picture of the depth camera has come yet (its pictures are 'rgb8')"
    assert looker.decide(1.0).text == why


@pytest.mark.parametrize("pan", [-0.35, 0.35, 1.2])
def test_a_head_that_is_turned_away_means_blind_speed(pan):
    looker = Looker([FLOOR])
    looker.to_base = camera(pan=pan)
    looker.stand(0.3)
    verdict = looker.decide(1.0)
    assert verdict.velocity.vx == pytest.approx(0.3)
    assert verdict.code == "head_away"
    assert verdict.text == "at most 0.3 m/s: the depth camera looks away from the way ahead"


def test_in_reverse_the_head_need_not_look_there():
    looker = Looker([FLOOR], limits=Limits(1.0, 0.5, 0.0, 2.0944, 1.0, 2.0944), blind_mps=0.5)
    looker.to_base = camera(pan=1.2)
    looker.stand(0.3)
    assert looker.back(-0.5).velocity.vx == -0.5


@pytest.mark.parametrize("tilt", [0.5, -1.0])
def test_a_head_that_looks_up_or_at_the_feet_means_blind_speed(tilt):
    looker = Looker([FLOOR])
    looker.to_base = camera(tilt)
    looker.stand(0.3)
    assert looker.decide(1.0).code == "head_away"


@pytest.mark.parametrize("height_m", [1.067, HOME_M, 1.417])
@pytest.mark.parametrize("tilt", [0.0, -0.3, LOOK_AHEAD])
def test_a_head_that_looks_ahead_frees_the_speed(tilt, height_m):
    looker = Looker([FLOOR])
    looker.to_base = camera(tilt, 0.2, height_m)
    looker.stand(0.3)
    assert looker.decide(1.0).velocity.vx == 1.0


def test_on_a_bend_speed_fits_the_visible_way():
    looker = Looker([FLOOR])
    looker.stand(0.3)
    allowed = [looker.decide(1.0, w=w) for w in (0.3, 1.0, 2.0)]
    speeds = [verdict.velocity.vx for verdict in allowed]
    assert speeds[0] == 1.0
    assert 0.3 < speeds[2] < speeds[1] < 1.0
    assert {(verdict.code, verdict.way) for verdict in allowed[1:]} == {("head_away", "bend")}
    assert allowed[2].velocity.w / speeds[2] == pytest.approx(2.0), "the arc stays"
    looker.to_base = camera(pan=0.25)
    looker.stand(0.1)
    assert looker.decide(1.0, w=1.0).velocity.vx > speeds[1], "the head follows the turn"


def test_a_recorded_depth_drive_replays_the_same_verdicts(tmp_path):
    looker = Looker([FLOOR, TABLE])
    sent = Velocity(0.0, 0.0, 0.0)
    with Recorder(tmp_path / "drive.gate", looker.gate.profile) as recorder:
        looker.gate = recorder.recorded(looker.gate)
        for _ in range(25):
            looker.stand(0.1)
            sent = looker.velocity = looker.gate.decide(Velocity(1.0, 0.0, 0.0), sent, looker.now_s).velocity
            looker.pose = Pose(looker.pose.x + 0.1 * sent.vx, 0.0, 0.0)
    decisions = list(replay(tmp_path / "drive.gate"))
    assert len(decisions) == 25
    assert all(decision.same for decision in decisions)
    assert "depth" in decisions[-1].replayed.text
