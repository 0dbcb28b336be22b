"""A choice that ends by itself is recorded and reported to all watchers."""

import pytest

from robots.shared import wire
from robots.shared.geometry.poses import STILL
from robots.shared.sentences import say
from tests.bridge.support import Outcome
from tests.bridge.tasks.test_input_routing import LISTENED, ask, bench, choose, chosen, connects, settled

__all__ = ["bench"]  # a fixture


def vanish(bench, *names):
    """Report that these topics have lost their subscribers on the robot."""
    left = {name: kind for name, kind in LISTENED.items() if name not in names}
    bench.core.tasks.routing.surveyed(left, bench.now_s)


def ended(bench):
    return bench.core.state(bench.now_s, []).choice_ended


def last_record(bench):
    bench.recorded()
    kind, what = bench.sink.records[-1]
    return kind, vars(what)


@pytest.mark.parametrize(
    ("use", "topic", "heard", "default"),
    [
        ("drive", "/phone_vel", "/phone_vel", "/key_vel"),
        ("speech", "/second_tts", "/second_tts/goal", "/tts"),
        ("motions", "/second_play", "/second_play/goal", "/play_motion"),
    ],
)
def test_lost_chosen_topic_is_reported_and_recorded(bench, use, topic, heard, default):
    choose(bench, use, topic)
    vanish(bench, heard)
    assert chosen(bench) == {}
    key = "{topic} has no subscriber any more: input goes to {default} again."
    assert ended(bench) == {use: wire.ChoiceEnd(1, topic, default, say(key, topic=topic, default=default))}
    expected = {"outcome": "gone", "use": use, "from": topic, "to": default}
    assert last_record(bench) == ("topic.choose", expected)


def test_lost_choice_is_reported_until_the_next_choice(bench):
    choose(bench, "drive", "/phone_vel")
    vanish(bench, "/phone_vel")
    assert bench.last == STILL
    bench.stick(0.0)
    bench.pass_time(1.0)
    connects(bench)  # only the default topic
    assert list(ended(bench)) == ["drive"]
    vanish(bench)
    choose(bench, "speech", "/second_tts")
    assert list(ended(bench)) == ["drive"]
    choose(bench, "drive", "/phone_vel")
    assert ended(bench) == {}


def test_two_topics_lost_together_are_both_reported(bench):
    choose(bench, "speech", "/second_tts")
    choose(bench, "motions", "/second_play")
    vanish(bench, "/second_tts/goal", "/second_play/goal")
    assert list(ended(bench)) == ["speech", "motions"]


def test_return_to_default_at_control_end_is_recorded_quietly(bench):
    choose(bench, "drive", "/phone_vel")
    bench.core.revoke(1, "over", bench.now_s)
    bench.pass_time(0.1)
    assert chosen(bench) == {}
    expected = {"outcome": "control_ended", "use": "drive", "from": "/phone_vel", "to": "/key_vel"}
    assert last_record(bench) == ("topic.choose", expected)
    assert ended(bench) == {}


def test_holders_return_to_default_is_an_ordinary_choice(bench):
    choose(bench, "speech", "/second_tts")
    choose(bench, "speech", None)
    assert last_record(bench) == ("topic.choose", {"outcome": "chosen", "use": "speech", "to": "/tts"})
    assert bench.sink.kinds == ["topic.choose"] * 4
    assert ended(bench) == {}


@pytest.mark.parametrize(
    ("spoil", "outcome"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
        (lambda bench: ask(bench, "speech", None), "overtaken"),
    ],
)
def test_failed_choice_records_its_reason(bench, spoil, outcome):
    bench.sink.open.clear()
    ask(bench, "speech", "/second_tts")
    spoil(bench)
    bench.sink.open.set()
    settled(bench)
    ends = [what for _, what in bench.sink.records if isinstance(what, Outcome)]
    assert [(end.outcome, end.to) for end in ends] == [(outcome, "/second_tts")]


def test_pages_get_the_lowest_role_for_publishing(bench):
    assert bench.core.tasks.capabilities.now().publishable_from == {"/notes": "operator"}


def test_bridge_end_ends_and_records_the_choice(bench):
    choose(bench, "speech", "/second_tts")
    bench.core.close(bench.now_s)
    expected = {"outcome": "bridge_ended", "use": "speech", "from": "/second_tts", "to": "/tts"}
    assert last_record(bench) == ("topic.choose", expected)
