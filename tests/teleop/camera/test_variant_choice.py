"""A slow viewer gets fewer pictures, then smaller ones; a fast one gets all."""

from itertools import pairwise

import pytest

from teleop.camera.variant_choice import FULL_AGAIN_S, LEAST_HZ, Quality


class Viewing:
    """A viewer of a camera of 15 Hz, whose clock the test sets."""

    def __init__(self, *, video=True, size="full", rate_hz=30.0):
        self.now_s = 0.0
        self.quality = Quality(size, video, rate_hz, self.now_s)
        self.changes = []
        self._owed = 0.0  # part of a picture that is left for the next step
        self.delay_s = 0.05  # from sending a picture to its acknowledgement

    def watch(self, seconds, shown_hz):
        """Watch while `shown_hz` pictures a second are acknowledged."""
        for _ in range(round(seconds * 15.0)):
            self.now_s += 1.0 / 15.0
            self.quality.offered(self.now_s)
            self._owed += shown_hz / 15.0
            if self._owed >= 1.0:
                self._owed -= 1.0
                self.quality.acknowledged(self.now_s, self.now_s - self.delay_s)
            if self.quality.decide(self.now_s):
                self.changes.append((round(self.now_s), self.quality.variant))
        return self


def test_a_fast_viewer_keeps_full_pictures():
    assert Viewing().watch(60.0, 15.0).changes == []


def test_a_viewer_at_the_least_rate_keeps_full_pictures():
    assert Viewing().watch(60.0, LEAST_HZ).changes == []


@pytest.mark.parametrize(("video", "lower"), [(True, "video"), (False, "small")])
def test_a_slow_viewer_gets_smaller_pictures(video, lower):
    viewing = Viewing(video=video).watch(5.0, 2.0)
    assert [variant for _, variant in viewing.changes] == [lower]


def test_a_viewer_for_whom_video_is_too_much_gets_small_pictures():
    viewing = Viewing().watch(60.0, 2.0)
    assert [variant for _, variant in viewing.changes] == ["video", "small"]
    viewing.watch(10.0, 15.0)
    assert viewing.quality.variant == "full"


def test_video_over_a_long_way_stays_video():
    viewing = Viewing().watch(4.0, 2.0)
    for _ in range(50):  # full pictures are tried again now and then
        viewing.watch(1.0, 2.0 if viewing.quality.variant == "full" else 6.0)
    assert "small" not in [variant for _, variant in viewing.changes]


def test_a_camera_that_begins_slowly_stays_full():
    viewing = Viewing()
    for _ in range(4):
        viewing.now_s += 0.6
        viewing.quality.offered(viewing.now_s)
        assert not viewing.quality.decide(viewing.now_s)
    assert viewing.quality.variant == "full"


def test_full_pictures_come_back_when_the_connection_does():
    viewing = Viewing().watch(4.0, 2.0).watch(20.0, 15.0)
    assert [variant for _, variant in viewing.changes] == ["video", "full"]
    assert viewing.quality.variant == "full"


def test_full_pictures_are_tried_ever_more_rarely():
    viewing = Viewing()
    for _ in range(6000):
        viewing.watch(0.1, 2.0 if viewing.quality.variant == "full" else 12.0)
    tries = [second for second, variant in viewing.changes if variant == "full"]
    gaps = [later - earlier for earlier, later in pairwise(tries)]
    assert all(later >= earlier - 1 for earlier, later in pairwise(gaps))
    assert gaps[0] < 5 * FULL_AGAIN_S[0]
    assert len(tries) < 12


def slow_then_tried():
    """A viewer with video over a slow connection, when full pictures are tried again."""
    viewing = Viewing().watch(4.0, 2.0)
    while viewing.quality.variant != "full":
        viewing.watch(0.1, 12.0)
    return viewing


def test_one_slow_full_picture_ends_a_try():
    viewing = slow_then_tried()
    assert viewing.quality.most_unacknowledged == 1
    sent_s, viewing.now_s = viewing.now_s, viewing.now_s + 0.6
    viewing.quality.acknowledged(viewing.now_s, sent_s)
    assert viewing.quality.has_failed
    assert viewing.quality.decide(viewing.now_s)
    assert viewing.quality.variant == "video"


def test_a_try_ends_while_its_picture_is_still_on_its_way():
    viewing = slow_then_tried()
    viewing.quality.unacknowledged(viewing.now_s + 0.2, viewing.now_s)
    assert not viewing.quality.decide(viewing.now_s + 0.2)
    viewing.quality.unacknowledged(viewing.now_s + 0.4, viewing.now_s)
    assert viewing.quality.decide(viewing.now_s + 0.4)
    assert viewing.quality.variant == "video"


def test_an_older_picture_does_not_judge_a_try():
    viewing = slow_then_tried()
    viewing.quality.acknowledged(viewing.now_s + 0.1, viewing.now_s - 0.5)
    assert not viewing.quality.has_failed
    viewing.quality.acknowledged(viewing.now_s + 0.2, viewing.now_s + 0.1)
    assert not viewing.quality.has_failed
    assert viewing.quality.most_unacknowledged > 1


def test_a_thumbnail_stays_small():
    viewing = Viewing(size="small", rate_hz=0.5).watch(30.0, 0.5)
    assert (viewing.quality.variant, viewing.changes) == ("small", [])
