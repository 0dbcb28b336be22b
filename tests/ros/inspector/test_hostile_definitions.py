"""A publisher's definition is limited: not only its own length, but also the size of its messages."""

from __future__ import annotations

import pytest

from robots.bridge.ros.inspector.definitions import parsed
from robots.bridge.topics.inspector.declined import Declined
from robots.shared import wire

EMBEDS = f"{'=' * 80}\nMSG: "


def nested(array: str, depth: int) -> str:
    """Nested arrays of messages; the innermost message has no fields."""
    text = f"e/T1[{array}] a\n"
    for level in range(1, depth):
        text += f"{EMBEDS}e/T{level}\ne/T{level + 1}[{array}] a\n"
    return f"{text}{EMBEDS}e/T{depth}\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (nested("32", 5), "elements in all"),
        (f"e/Row[100000] rows\n{EMBEDS}e/Row\nfloat64[100000] cells\n", "10000000000 elements in all"),
        (f"e/Row[] rows\n{EMBEDS}e/Row\nfloat64[100001] cells\n", "100001 elements in all"),
        (
            "".join(f"uint8 C{number}=1\n" for number in range(8000))
            + "".join(f"uint8 f{number}\n" for number in range(1500)),
            "names and constants are too long",
        ),
        (
            "".join(f"e/Part f{number}\n" for number in range(1000))
            + f"{EMBEDS}e/Part\nuint8 {'x' * 1000}\n",
            "names and constants are too long",
        ),
    ],
)
def test_a_definition_of_huge_messages_is_refused(text, why):
    with pytest.raises(Declined) as refused:
        parsed("e/T", text)
    assert refused.value.refusal.code == "bad_definition"
    assert why in refused.value.refusal.text


def test_a_large_but_allowed_definition_is_shown_in_a_line():
    constants = "".join(f"uint8 C{number}=1\n" for number in range(100))
    fields = "".join(f"uint8[10000] f{number}\n" for number in range(400))
    definition = parsed("e/T", constants + fields)
    answer = wire.encode(wire.Described("e/T", definition.md5, definition.fields, definition.text))
    assert len(answer) < 1024 * 1024


def test_a_publishers_text_is_shortened_in_our_sentences():
    with pytest.raises(Declined) as refused:
        parsed("e/T", f"{'x' * 100_000} y")
    assert len(refused.value.refusal.text) < 1000
