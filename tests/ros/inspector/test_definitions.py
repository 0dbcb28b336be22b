"""A publisher's message definition is accepted if its md5 sum fits. Its size is limited."""

from __future__ import annotations

from pathlib import Path

import pytest

from robots.bridge.ros.inspector.definitions import (
    DEEPEST,
    LARGEST_TEXT,
    LONGEST_ARRAY,
    MOST_FIELDS,
    Definitions,
    installed,
    parsed,
    sums,
)
from robots.bridge.topics.inspector.declined import Declined
from robots.shared.ros.message_types.classes import message_class

HEADER, POSE = "std_msgs/Header", "geometry_msgs/Pose"
LEVEL = "lab_msgs/Level"
BREAK = f"{'=' * 80}\nMSG: "


def header_of(type_name: str, text: str) -> dict[str, str]:
    """A publisher's connection header with this definition."""
    return {"type": type_name, "md5sum": parsed(type_name, text).md5, "message_definition": text}


def nested(levels: int, fields: int) -> str:
    """Return a definition of `levels` types; each type has `fields` fields of the next type."""
    texts = ["".join(f"T{level + 1} {chr(97 + n)}\n" for n in range(fields)) for level in range(levels)]
    own, *embedded = [*texts, "bool last\n"]
    return own + "".join(f"{BREAK}lab_msgs/T{level}\n{text}" for level, text in enumerate(embedded, start=1))


@pytest.mark.parametrize(
    "text",
    [
        nested(levels=12, fields=2),
        nested(levels=DEEPEST, fields=1),
        f"uint8[{LONGEST_ARRAY + 1}] data\n",
        f"bool on\n# {'x' * LARGEST_TEXT}\n",
        "".join(f"bool on{number}\n" for number in range(MOST_FIELDS + 1)),
    ],
    ids=["many nested", "deep", "long array", "long text", "many"],
)
def test_a_definition_without_end_is_not_read(text: str) -> None:
    with pytest.raises(Declined) as caught:
        parsed(LEVEL, text)
    assert caught.value.refusal.code == "bad_definition"


@pytest.mark.parametrize(
    "text",
    [nested(levels=8, fields=2), nested(levels=DEEPEST - 1, fields=1), f"uint8[{LONGEST_ARRAY}] data\n"],
    ids=["many nested", "deep", "long array"],
)
def test_a_large_one_is(text: str) -> None:
    assert parsed(LEVEL, text).fields


def test_a_type_in_another_version_uses_its_publishers_words(tmp_path: Path) -> None:
    newer = header_of("std_msgs/String", "string data\nstring language\n")
    definition = Definitions(tmp_path).of_connection(newer)
    assert [field.name for field in definition.fields] == ["data", "language"]
    assert not definition.known
    here = installed("std_msgs/String")
    assert here is not None and here.md5 != definition.md5


SHORT = "# as rosjava\nHeader header\ngeometry_msgs/PoseStamped[] route\nStation next\nuint8 IDLE=0\n"
STATION = f"{BREAK}lab_msgs/Station\nstring name\nstd_msgs/Header seen\n"
WHOLE = (
    SHORT
    + STATION
    + "".join(
        f"{BREAK}{name}\n{found._full_text.split('=' * 80)[0]}"
        for name, found in (
            (kind, message_class(kind))
            for kind in (HEADER, f"{POSE}Stamped", POSE, "geometry_msgs/Point", "geometry_msgs/Quaternion")
        )
    )
)


@pytest.mark.parametrize(
    "text",
    [
        WHOLE,
        SHORT + STATION,
        (SHORT + STATION).replace("\n", "\r\n"),
        (SHORT + STATION).replace("\n", "\r"),
        SHORT.replace(" header", "\t header  # why") + "\n\n" + STATION.replace("=" * 80, "=" * 60 + " "),
        SHORT + STATION.replace("MSG: lab_msgs/Station", "MSG:lab_msgs/Station ") + "\n  \n",
        "\ufeff" + SHORT + STATION,
        SHORT + STATION.replace("=", "-"),
        SHORT + STATION.removeprefix("=" * 80 + "\n"),
        SHORT + STATION * 2,
        SHORT + STATION + STATION.removeprefix("=" * 80 + "\n"),
    ],
    ids=[
        *("whole", "short", "CRLF", "CR", "other blanks", "other break"),
        *("mark", "dashes", "no break", "twice", "twice without a break"),
    ],
)
def test_a_text_without_the_types_it_uses_is_completed(tmp_path: Path, text: str) -> None:
    known = parsed(LEVEL, WHOLE)
    header = {"type": LEVEL, "md5sum": known.md5, "message_definition": text}
    found = Definitions(tmp_path).of_connection(header)
    assert (found.fields, sums(found)) == (known.fields, sums(known))
    assert Definitions(tmp_path).of_type(LEVEL).md5 == known.md5  # it is kept as a whole


def test_a_text_is_completed_by_what_another_publisher_sent(tmp_path: Path) -> None:
    definitions = Definitions(tmp_path)
    outer = "Level inner\n"
    sum_ = parsed("lab_msgs/Outer", f"{outer}{BREAK}{LEVEL}\nfloat64 level\n").md5
    short = {"type": "lab_msgs/Outer", "md5sum": sum_, "message_definition": outer}
    with pytest.raises(Declined) as caught:
        definitions.of_connection(short)
    assert caught.value.refusal.code == "type_unknown"
    assert "does not know lab_msgs/Level, which lab_msgs/Outer uses" in caught.value.refusal.text
    definitions.of_connection(header_of(LEVEL, "float64 level\n"))
    assert definitions.of_connection(short).md5 == sum_


def test_a_text_that_ours_completes_to_another_sum_is_refused(tmp_path: Path) -> None:
    theirs = header_of(LEVEL, f"Header header\n{BREAK}{HEADER}\ntime stamp\n")
    with pytest.raises(Declined) as caught:
        Definitions(tmp_path).of_connection(theirs | {"message_definition": "Header header\n"})
    assert caught.value.refusal.code == "definition_differs"
    assert "with the console’s own std_msgs/Header" in caught.value.refusal.text


def test_every_message_within_a_definition_has_its_sum() -> None:
    header, pose, stamped = (installed(kind) for kind in (HEADER, POSE, f"{POSE}Stamped"))
    assert header is not None and pose is not None and stamped is not None
    assert {header.md5, pose.md5, stamped.md5} < sums(stamped)
    assert sums(parsed(LEVEL, f"float64 level\n{BREAK}{POSE}\nbool unused\n")) == {
        parsed(LEVEL, "float64 level\n").md5
    }


def test_and_not_at_all_if_it_says_none(tmp_path: Path) -> None:
    mute = header_of("std_msgs/String", "string data\nstring language\n") | {"message_definition": ""}
    with pytest.raises(Declined) as caught:
        Definitions(tmp_path).of_connection(mute)
    assert caught.value.refusal.code == "type_unknown"


def test_a_definition_changed_on_disk_is_refused(tmp_path: Path) -> None:
    header = header_of(LEVEL, "float64 level\n")
    Definitions(tmp_path).of_connection(header)
    assert Definitions(tmp_path).of_type(LEVEL).md5 == header["md5sum"]
    (file,) = tmp_path.iterdir()
    file.write_text("int64 level\n")
    with pytest.raises(Declined) as caught:
        Definitions(tmp_path).of_type(LEVEL)
    assert caught.value.refusal.code == "type_unknown"
