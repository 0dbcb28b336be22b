"""The rate of a topic that is shown."""

import pytest

from robots.bridge.topics.inspector.subscriptions import rate_hz


@pytest.mark.parametrize(
    ("arrivals", "now_s", "expected"),
    [
        ([], 5.0, None),
        ([1.0], 5.0, None),
        ([n / 100 for n in range(2000)], 20.0, 100.0),
        ([0.0, 10.0, 20.0, 30.0], 39.0, 0.1),  # one in the window
        ([0.0, 10.0, 20.0, 30.0], 61.0, 0.0),  # three messages are missing
        ([0.0, 0.1, 0.2], 9.0, 10.0),
        ([0.0, 0.1, 0.2], 11.0, 0.0),
        ([0.0, 1000.0, 1000.1, 1000.2], 1000.2, 10.0),  # after a long silence
    ],
)
def test_rates_of_frequent_rare_and_ended_messages_are_right(arrivals, now_s, expected):
    assert rate_hz(arrivals, now_s) == expected
