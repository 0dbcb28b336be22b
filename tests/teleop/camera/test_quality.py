"""A slow viewer gets fewer pictures, then smaller ones; a fast one gets all."""

from itertools import pairwise

import pytest

from teleop.camera.quality import FULL_AGAIN_S, LEAST_HZ, Quality


class Viewing:
    """A viewer of a camera of 15 Hz, with the clock in hand."""

    def __init__(self, *, video=True, size="full", rate_hz=30.0):
        self.now_s = 0.0
        self.quality = Quality(size, video, rate_hz, self.now_s)
        self.changes = []

    def watch(self, seconds, shown_hz):
        """Watch while `shown_hz` pictures a second are acknowledged."""
        owed = 0.0
        for _ in range(round(seconds * 15.0)):
            self.now_s += 1.0 / 15.0
            self.quality.offered(self.now_s)
            owed += shown_hz / 15.0
            if owed >= 1.0:
                owed -= 1.0
                self.quality.acknowledged(self.now_s)
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


def test_a_thumbnail_stays_small():
    viewing = Viewing(size="small", rate_hz=0.5).watch(30.0, 0.5)
    assert (viewing.quality.variant, viewing.changes) == ("small", [])
