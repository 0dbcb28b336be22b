"""Foxglove's own libraries read a robot through the real server."""

from __future__ import annotations

import json
import subprocess
import time
import urllib.request
from typing import Any

import pytest

from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.script.support import token

ROBOT = PRACTICE_ROBOTS[0].slug
NODE = REPOSITORY / ".venv/bin/node"
CLIENT = REPOSITORY / "tests/script/programs/foxglove_client.js"
PICTURES = "/xtion/rgb/image_raw/compressed"
LONGEST_S = 30.0


def reads(stack: Stack, token: str, *topics: str, query: str = "") -> list[dict[str, Any]]:
    """Run the client until it has all of these, and return what it says."""
    address = f"ws://{stack.hosts[0]}:{stack.port}/foxglove/{ROBOT}{query}"
    done = subprocess.run(
        [NODE, CLIENT, address, token, *topics],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=True,
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def message_of(said: list[dict[str, Any]], topic: str) -> dict[str, Any]:
    [found] = [one for one in said if one.get("topic") == topic]
    assert abs(found["stamp"] - time.time()) < LONGEST_S
    return found["message"]


def test_camera_scan_and_tf_are_read_and_decoded(stack):
    said = reads(
        stack, token(stack, "observer", "topics"), PICTURES, "/scan_raw", "/tf", "parameters", "graph"
    )
    assert said[0] == {"protocol": "foxglove.sdk.v1"}
    assert said[1]["capabilities"] == ["parameters", "connectionGraph"]
    picture = message_of(said, PICTURES)
    assert "jpeg" in picture["format"]
    assert picture["data"]["first"][:2] == [0xFF, 0xD8]
    scan = message_of(said, "/scan_raw")
    steps = (scan["angle_max"] - scan["angle_min"]) / scan["angle_increment"]
    assert scan["ranges"]["length"] == round(steps) + 1
    [transform, *_] = message_of(said, "/tf")["transforms"]
    assert sum(part**2 for part in transform["transform"]["rotation"].values()) == pytest.approx(1.0)
    graph = [one["published"] for one in said if "published" in one][-1]
    assert graph["/scan_raw"]
    assert next(one for one in said if one.get("id") == "all")["parameters"] > 10


def test_publishing_is_refused_in_words(stack):
    said = reads(stack, token(stack, "operator", "topics", "drive"), "status")
    assert any(one.get("status", "").startswith("read_only: ") and one["level"] == 2 for one in said)


def test_ticket_opens_once(stack):
    key = token(stack, "observer", "topics")
    query = ticket(stack, key)
    assert reads(stack, "", "/scan_raw", query=query)[-1]["code"] in (1000, 1005)
    again = reads(stack, "", "/scan_raw", query=query)
    assert again[-1]["code"] == 4401
    assert "used already" in again[-1]["reason"]
    assert message_of(reads(stack, "", "/scan_raw", query=ticket(stack, key)), "/scan_raw")


def ticket(stack: Stack, key: str) -> str:
    """Return the query of an address with a new ticket."""
    request = urllib.request.Request(  # noqa: S310
        f"{stack.url}/api/v1/robots/{ROBOT}/tickets",
        json.dumps({"door": "foxglove"}).encode(),
        {"Authorization": f"Bearer {key}", "Content-Type": "application/json"},
    )
    with urllib.request.urlopen(request, timeout=10.0) as answer:  # noqa: S310
        return "?" + json.load(answer)["path"].partition("?")[2]
