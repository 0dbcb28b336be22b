"""Versions of types: DDS connects publishers and listeners by the name of a type, whatever its fields are.

So a message may have other fields than its reader knows. The digest of them (type hash) tells; a publisher's ROS before
Iron has none.
"""

from __future__ import annotations

import json
import os
import time
from functools import cache
from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.network.graph import NO_NAME, node_name
from robots.shared.texts import MOST_NODES

HASHED = "RIHS"  # begins each digest
MOST_KNOWN = 500  # publishers of a topic
LOOK_S = 0.1  # between two looks for the publisher of a message: it may have left


class Versions:
    """The publishers of one topic whose type has other fields than the package that is installed here."""

    def __init__(self, node: Node, topic: str, type_name: str) -> None:
        self._node, self._topic = node, topic
        self._ours = hash_of(type_name)
        self._known: dict[bytes, str] = {}  # by publisher: its node, if its type differs
        self._looked_s = float("-inf")

    def other(self, info: Any) -> str:
        """Return the node that sent a message with other fields; empty: they are the same, or that is not known."""
        gid = info.get("publisher_gid")
        if not gid or not self._ours:
            return ""
        key = bytes(gid["data"])
        unknown = self._known.get(key, NO_NAME) == NO_NAME  # DDS may tell the name later
        if unknown and time.monotonic() - self._looked_s > LOOK_S:
            self._look()
        return self._known.get(key, "")

    def _look(self) -> None:
        self._looked_s = time.monotonic()
        if self._node.count_publishers(self._topic) > MOST_NODES:  # a look would take long
            return
        while len(self._known) > MOST_KNOWN:
            del self._known[next(iter(self._known))]
        for one in self._node.get_publishers_info_by_topic(self._topic):
            self._known[bytes(one.endpoint_gid)] = node_name(one) if other_hash(one, self._ours) else ""


def told_hash(endpoint: TopicEndpointInfo) -> str:
    """Return the digest that an endpoint tells; empty: its ROS has none."""
    told = str(endpoint.topic_type_hash)
    return told if told.startswith(HASHED) else ""


def other_hash(endpoint: TopicEndpointInfo, ours: str) -> str:
    """Return the digest that an endpoint tells if it is not `ours`; empty: the same, or one of the two is not known."""
    theirs = told_hash(endpoint)
    return theirs if ours and theirs != ours else ""


@cache
def hash_of(type_name: str, part: str = "") -> str:
    """Return the digest of the fields of an installed message, or of a part of a service or action; empty: unknown."""
    package, *kinds, name = type_name.split("/")
    kind = kinds[0] if kinds else "msg"
    wanted = f"{package}/{kind}/{name}" + (f"_{part}" if part else "")
    text = package_file(package, kind, f"{name}.json")
    for one in json.loads(text)["type_hashes"] if text else []:
        if one["type_name"] == wanted:
            return str(one["hash_string"])
    return ""


def package_file(package: str, kind: str, name: str) -> str | None:
    """Return the text of a file of an installed package."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        file = Path(prefix) / "share" / package / kind / name
        if file.is_file():
            return file.read_text(encoding="utf-8")
    return None
