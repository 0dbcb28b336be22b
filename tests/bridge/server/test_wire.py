"""Accepted messages: patterns for names match whole names; only the rule for speech refuses long texts."""

import json

import msgspec
import pytest

from robots.shared import wire
from tests.bridge.support import Bench

TAB = "0123456789abcdef"


@pytest.mark.parametrize(
    "message",
    [
        {"t": "choose", "fence": 1, "use": "drive", "topic": "/key_vel"},
        {"t": "publish_stop", "fence": 1, "topic": "/notes"},
        {"t": "publish", "fence": 1, "topic": "/notes", "type": "std_msgs/String"},
        {"t": "say", "fence": 1, "text": "hello", "language": "en-GB"},
        {"t": "hello", "tab": TAB},
    ],
    ids=lambda message: message["t"],
)
def test_a_name_ends_where_it_ends(message):
    wire.browser_message(json.dumps(message))
    last = list(message)[-1]
    with pytest.raises(wire.WireError) as refused:
        wire.browser_message(json.dumps(message | {last: f"{message[last]}\n"}))
    assert refused.value.refusal.code == "invalid"


@pytest.mark.parametrize("characters", [501, 4001, 7000])
def test_a_text_that_is_too_long_is_refused_as_that(characters):
    bench = Bench().online().granted()
    raw = json.dumps({"t": "say", "fence": 1, "text": "x" * characters, "language": "en-GB"})
    order = wire.browser_message(raw)
    refusal = bench.order(order)
    assert refusal.code == "text_too_long"


@pytest.mark.parametrize(
    ("report", "path"),
    [
        (
            {"t": "refused", "of": "say", "refusal": {"code": "c", "text": "No.", "rule": "nobody"}},
            "refusal.rule",
        ),
        ({"t": "stopped", "stop": {"state": "halted"}}, "stop.state"),
        ({"t": "offers", "publishable_from": {"/notes": "king"}}, "publishable_from"),
        ({"t": "offers", "uses": {"fly": {"topic": "/wings", "type": "std_msgs/Empty"}}}, "uses"),
    ],
)
def test_a_word_that_is_none_of_its_set_ends_at_the_door(report, path):
    with pytest.raises(msgspec.ValidationError, match=path):
        wire.link_report(json.dumps(report))
