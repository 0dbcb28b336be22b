"""The ring keeps the last minute within its bound: pictures are thinned, and go first."""

from __future__ import annotations

from robots.bridge.recorder.black_box.ring import MOST_LATCHED_BYTES, Message, Origin, Ring

SECOND = 10**9
SCAN = Origin("/scan", "ros1", "sensor_msgs/LaserScan", "", "", "/laser")
PICTURE = Origin("/camera", "ros1", "sensor_msgs/CompressedImage", "", "", "/driver")
STATIC = Origin("/tf_static", "ros1", "tf2_msgs/TFMessage", "", "", "/state", latched=True)
MAP = Origin("/map", "ros1", "nav_msgs/OccupancyGrid", "", "", "/server", latched=True)


def message(origin: Origin, at_s: float, size: int = 100) -> Message:
    return Message(origin, 0, int(at_s * SECOND), bytes(size))


def times(ring: Ring, since_s: float = 0.0) -> list[float]:
    return [one.at_ns / SECOND for one in ring.since(int(since_s * SECOND))]


def test_only_the_last_minute_is_kept() -> None:
    ring = Ring(kept_s=60.0)
    for at_s in range(100):
        ring.put(message(SCAN, at_s))
    assert times(ring) == list(range(39, 100))
    assert ring.held_s(99 * SECOND) == 60


def test_pictures_come_at_a_lower_rate() -> None:
    ring = Ring()
    kept = [ring.put(message(PICTURE, number / 30)) for number in range(90)]
    assert 5 <= sum(kept) <= 7  # of three seconds
    assert all(ring.put(message(SCAN, 3.0 + number / 30)) for number in range(90))


def test_the_oldest_pictures_go_first_then_the_oldest_messages() -> None:
    ring = Ring(most_bytes=10_000)
    for at_s in range(5):
        ring.put(message(SCAN, at_s, 1000))
        ring.put(message(PICTURE, at_s + 0.5, 1000))
    assert ring.size <= 10_000
    assert times(ring) == [0, 1, 2, 2.5, 3, 3.5, 4, 4.5]
    for at_s in range(5, 12):
        ring.put(message(SCAN, at_s, 1000))
    assert times(ring) == list(range(4, 12))


def test_latched_messages_still_hold_after_the_minute() -> None:
    ring = Ring(kept_s=60.0)
    ring.put(message(MAP, 0))
    ring.put(message(MAP, 1))
    for at_s in range(2, 100):
        ring.put(message(SCAN, at_s))
    assert times(ring, since_s=90) == [1, *range(90, 100)]


def test_a_large_map_throws_out_no_transform() -> None:
    ring, other = Ring(), MAP._replace(topic="/costmap")
    ring.put(message(STATIC, 0))
    ring.put(message(MAP, 1, MOST_LATCHED_BYTES * 2 // 3))
    ring.put(message(other, 2, MOST_LATCHED_BYTES // 2))
    assert times(ring, since_s=50) == [0, 2]
    ring.put(message(other, 3, MOST_LATCHED_BYTES))  # the map before it does not hold any more
    assert times(ring, since_s=50) == [0]


def test_lost_messages_are_known_as_long_as_the_others() -> None:
    ring = Ring()
    for at_s in (5, 20, 25):
        ring.missed(SCAN, 2, at_s * SECOND)
    assert ring.missing_since(10 * SECOND) == {SCAN: 4}
