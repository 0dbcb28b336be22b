"""The simulated hands of benchmarks/driving/stick.py follow the stated model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.driving import hand_model
from benchmarks.driving.hand_model import Movement


def test_the_shipped_traces_match_the_generator(tmp_path: Path) -> None:
    hand_model.record(tmp_path / "hands.json")
    assert (tmp_path / "hands.json").read_text() == hand_model.RECORDED.read_text()


def test_a_hand_goes_where_it_means_to_and_rests_there() -> None:
    movements = [Movement(1.0, 0.5, 0.8, 0.0), Movement(2.0, 0.5, 0.0, 0.0)]
    times_s = np.array([0.0, 1.0, 1.25, 1.5, 2.0, 2.5, 9.0])
    assert hand_model.meant(movements, times_s)[:, 0] == pytest.approx([0.0, 0.0, 0.4, 0.8, 0.8, 0.0, 0.0])


def test_a_released_stick_measures_zero_a_held_one_tremor() -> None:
    for trace in hand_model.recorded():
        meant = hand_model.meant(trace.movements, trace.times_s)
        let_go = (meant == 0.0).all(axis=1)
        assert not trace.measured[let_go].any()
        shaken = np.std((trace.measured - meant)[~let_go])
        assert 0.8 * min(hand_model.TREMORS) < shaken < 1.2 * max(hand_model.TREMORS)
