"""``python -m robots.bridge.ros2.sensors.map``: see `robots.bridge.maps.map_process`."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.bridge.maps.map_process import Without, agreed, run
from robots.bridge.ros2.network.graph import Graph, node_name
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import kept
from robots.bridge.ros2.sensors.cdr import Cdr
from robots.shared.configuration.robot_ros import ros2
from robots.shared.maps.occupancy import BadMap, taken_from
from robots.shared.records.record_sink import TakenMap
from robots.shared.sentences import reason_of, say

CALLER = "fleet_map"
FOUND_S = 3.0  # by which the domain's nodes are found
MESSAGE_S = 5.0  # the map's publisher keeps it, and sends it at once
LOOK_S = 0.05
LEAVE_S = 0.5


def read_map(wanted: MapWanted) -> TakenMap | NoMap:
    """Return the map on which all publishers agree. If they differ, navigation may have any of them."""
    participant = Participant(f"{CALLER}_{os.getpid()}", ros2(wanted.ros).domain_id)
    try:
        return _read(participant, wanted)
    finally:
        participant.close(LEAVE_S)


def _read(participant: Participant, wanted: MapWanted) -> TakenMap | NoMap:
    graph, topic = Graph(participant.node), wanted.topic
    until_s = time.monotonic() + FOUND_S
    while not (publishers := graph.publishers(topic.name)) and time.monotonic() < until_s:
        time.sleep(LOOK_S)
    fitting = [one for one in publishers if one.topic_type == topic.type]
    gids = [bytes(one.endpoint_gid) for one in fitting]
    maps: dict[bytes, TakenMap | NoMap] = {}  # by publisher

    def take(raw: bytes, info: Any) -> None:
        gid = info.get("publisher_gid")
        # None before Iron: then each publisher's message is taken for one of them
        key = bytes(gid["data"]) if gid else gids[len(maps) % len(gids)]
        if key in gids:
            maps[key] = _map_in(raw)

    if fitting:
        qos = kept(one.qos_profile for one in fitting)
        qos.depth = len(fitting)
        # One that is too large is read all the same, so that it can be named.
        participant.listen(topic.name, topic.type, take, qos, sys.maxsize)
        participant.start()
    until_s = time.monotonic() + MESSAGE_S
    while len(maps) < len(fitting) and time.monotonic() < until_s:
        time.sleep(LOOK_S)
    answers: dict[str, TakenMap | NoMap | Without] = {
        node_name(one): NoMap(
            say("it publishes {type}, not {wanted}", type=one.topic_type, wanted=topic.type)
        )
        for one in publishers
        if one.topic_type != topic.type
    }
    for one, gid in zip(fitting, gids, strict=True):
        answers[node_name(one)] = maps.get(gid) or Without(say("has published no map yet"))
    return agreed(answers, topic.name)


def _map_in(raw: bytes) -> TakenMap | NoMap:
    try:
        message = Cdr(raw)
        _, frame = message.header()
        message.stamp_s()  # when it was loaded
        (resolution_m,) = message.values("f", 4)
        width, height = message.values("2I", 4)
        origin = message.values("7d", 8)
        count = message.number()
        return taken_from(frame, resolution_m, width, height, origin, count, message.data(count))
    except BadMap as bad:
        return NoMap(reason_of(bad))
    except ValueError:
        return NoMap(say("the message is incomplete"))


if __name__ == "__main__":
    run(read_map)
