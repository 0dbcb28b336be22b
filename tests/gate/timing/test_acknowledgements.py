"""The delay of the robot's computer is measured at each reading, by the bytes that it acknowledged."""

import pytest

from robots.bridge.gate.timing.acknowledgements import RoundTrips

PERIOD_S = 0.05
SIZE = 52


class Line:
    """A connection with one reading and one write per period; `way_s` is the round trip."""

    def __init__(self, way_s):
        self.way_s = way_s
        self.now_s = 100.0
        self.round_trips = RoundTrips()
        self.total = 0
        self.acknowledgements = []  # time, bytes in total

    def passes(self, seconds, writes=True):
        """Let time pass; return the result of each reading."""
        shown = []
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            acknowledged = max(
                (total for at_s, total in self.acknowledgements if at_s <= self.now_s), default=0
            )
            shown.append(self.round_trips.took_s(acknowledged, self.now_s))
            if writes:
                self.total += SIZE
                self.round_trips.wrote(self.total, self.now_s)
                self.acknowledgements.append((self.now_s + self.way_s, self.total))
        return [took_s for took_s in shown if took_s is not None]


@pytest.mark.parametrize("way_s", [0.001, 0.04, 0.22, 0.43])
def test_reported_delay_is_exact_within_a_period(way_s):
    delays_s = Line(way_s).passes(5.0)
    assert len(delays_s) > 80
    assert max(delays_s) <= way_s
    assert min(delays_s) >= way_s - PERIOD_S


@pytest.mark.parametrize("way_s", [0.001, 0.22])
def test_a_pause_does_not_change_the_speed_of_the_line(way_s):
    line = Line(way_s)
    delays_s = [*line.passes(2.0), *line.passes(2.0, writes=False), *line.passes(2.0)]
    assert max(delays_s) <= way_s
    assert min(delays_s) >= way_s - PERIOD_S
    line.passes(1.0, writes=False)
    assert line.passes(1.0, writes=False) == []


def test_a_slowing_connection_is_reported_while_it_slows():
    line = Line(0.02)
    line.passes(1.0)
    line.way_s = 0.4
    assert max(line.passes(0.5)) == pytest.approx(0.4, abs=2 * PERIOD_S)


def test_a_line_without_acknowledgements_is_late_all_the_time():
    line = Line(0.02)
    line.passes(1.0)
    line.way_s = 1e6
    delays_s = line.passes(1.0)
    assert delays_s[1:] == sorted(delays_s[1:])
    assert delays_s[-1] == pytest.approx(1.0, abs=2 * PERIOD_S)
