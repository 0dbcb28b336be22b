"""Fields for a message must fit its definition; a refusal contains the path of the wrong field."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.shared.messages.fields import FLOATS, INTEGERS, STAMPS, BadField, fit_fields
from robots.shared.messages.packing import Broken, Detail, Layout
from robots.shared.wire import Field

ALL = Detail(10**6, 10**6, 10**6)
VECTOR = [Field(axis, "float64") for axis in "xyz"]
TWIST = [Field(part, "geometry_msgs/Vector3", fields=VECTOR) for part in ("linear", "angular")]
HEADER = [Field("seq", "uint32"), Field("stamp", "time"), Field("frame_id", "string")]
EVERYTHING = [
    Field("header", "std_msgs/Header", fields=HEADER),
    *(Field(f"a_{name}", name) for name in (*INTEGERS, *FLOATS, *STAMPS)),
    Field("level", "uint8", constants={"LOW": 1, "HIGH": 9}),
    Field("covariance", "float64", array=3),
    Field("points", "geometry_msgs/Point", array=-1, fields=VECTOR),
    Field("names", "string", array=-1),
    Field("flags", "bool", array=-1),
    Field("nothing", "std_msgs/Empty"),
]


def refused(given: dict[str, Any], definition: list[Field] = EVERYTHING) -> tuple[str, str]:
    """The path of the wrong field, and the text."""
    with pytest.raises(BadField) as caught:
        fit_fields(definition, given)
    assert caught.value.refusal.code == "bad_field"
    path = caught.value.refusal.figures["path"]
    assert isinstance(path, str)
    return path, caught.value.refusal.text


@pytest.mark.parametrize(
    "given",
    [
        {"linear": {"x": 0.2, "y": 0}, "angular": {"z": 1}},
        {"linear.x": 0.2, "linear.y": 0, "angular.z": 1},
        {"linear.x": 0.2, "linear": {"y": 0}, "angular": {"z": 1}},
        {"linear": {"y": 0}, "linear.x": 0.2, "angular.z": 1},
    ],
)
def test_nested_and_dotted_fields_are_the_same(given):
    assert fit_fields(TWIST, given) == {"linear": {"x": 0.2, "y": 0.0}, "angular": {"z": 1.0}}


def test_bytes_may_be_given_as_base64():
    picture = [Field("data", "uint8", array=-1), Field("words", "string", array=-1)]
    assert fit_fields(picture, {"data": "AQL/"}) == fit_fields(picture, {"data": [1, 2, 255]})
    assert refused({"data": "A!"}, picture)[0] == "data"
    assert refused({"words": "AQL/"}, picture)[0] == "words"


@pytest.mark.parametrize(
    ("given", "path", "says"),
    [
        ({"linear.x": "fast"}, "linear.x", "a number (float64)"),
        ({"linear": {"q": 1}}, "linear.q", "the fields are: x, y, z"),
        ({"lineal.x": 1}, "lineal", "There is no field lineal"),
        ({"linear": 5}, "linear", "the fields of a message are needed, not 5"),
        ({"linear": {"x": 1}, "linear.x": 2}, "linear.x", "twice"),
        ({"linear": 5, "linear.x": 2}, "linear", "twice"),
        ({"linear.x.y": 2}, "linear.x", "a number"),
        ({"linear": None}, "linear", "nothing"),
    ],
)
def test_a_wrong_field_of_a_twist_is_named(given, path, says):
    assert refused(given, TWIST)[0] == path
    assert says in refused(given, TWIST)[1]


@pytest.mark.parametrize(
    ("given", "path", "says"),
    [
        ({"a_int8": 128}, "a_int8", "from -128 to 127"),
        ({"a_uint64": -1}, "a_uint64", "from 0 to"),
        ({"a_char": 256}, "a_char", "255"),
        ({"a_int32": 1.5}, "a_int32", "a whole number"),
        ({"a_int32": True}, "a_int32", "not true"),
        ({"a_float64": True}, "a_float64", "not true"),
        ({"a_float64": math.nan}, "a_float64", "finite"),
        ({"a_float64": 10**400}, "a_float64", "finite"),
        ({"a_float32": 1e39}, "a_float32", "too large"),
        ({"a_bool": 2}, "a_bool", "true or false"),
        ({"a_bool": 1.0}, "a_bool", "true or false"),
        ({"level": "MIDDLE"}, "level", "not the text “MIDDLE”"),
        ({"level": 300}, "level", "255"),
        ({"covariance": [1, 2]}, "covariance", "exactly 3 values, not 2"),
        ({"covariance": [1, "a", 3]}, "covariance[1]", "a number"),
        ({"points": [{"x": 1}, {"x": "far"}]}, "points[1].x", "a number"),
        ({"points.0.x": 1, "points.2.x": 1}, "points", "without a gap"),
        ({"points": "here"}, "points", "an array is needed, not the text"),
        ({"names": ["a", 5]}, "names[1]", "a text, not 5"),
        ({"header.frame_id": "a\0b"}, "header.frame_id", "null"),
        ({"a_time": "yesterday"}, "a_time", '"now"'),
        ({"a_duration": "now"}, "a_duration", "seconds"),
        ({"a_time": -1}, "a_time", "from 0"),
        ({"a_time": 1e300}, "a_time", "4294967295"),
        ({"a_time": 2**32}, "a_time", "4294967295"),
        ({"a_time": 10**400}, "a_time", "a very large number"),
        ({"a_time": math.inf}, "a_time", "not inf"),
        ({"a_time": math.nan}, "a_time", "not nan"),
        ({"a_time.secs": 1e300}, "a_time.secs", "a very large number"),
        ({"a_duration": 1e300}, "a_duration", "2147483647"),
        ({"a_duration": -1e300}, "a_duration", "-2147483648"),
        ({"a_duration": -(10**5000)}, "a_duration", "a very large number"),
        ({"header.stamp": 1e300}, "header.stamp", "4294967295"),
        ({"a_int32": math.inf}, "a_int32", "not inf"),
        ({"a_int32": math.nan}, "a_int32", "not nan"),
        ({"a_uint64": 10**5000}, "a_uint64", "a very large number"),
        ({"a_float32": 10**300}, "a_float32", "a very large number"),
        ({"names": [10**5000]}, "names[0]", "a very large number"),
        ({"a_time.nsecs": 10**9}, "a_time.nsecs", "999999999"),
        ({"a_time": {"hours": 1}}, "a_time", "secs and nsecs"),
        ({"nothing.at_all": 1}, "nothing.at_all", "the fields are: none"),
    ],
)
def test_unfitting_value_is_refused_with_its_path(given, path, says):
    found, text = refused(given)
    assert found == path
    assert says in text


def test_a_thousand_levels_of_names_are_refused():
    deep: dict[str, Any] = {}
    for _ in range(900):
        deep = {"linear": deep}
    assert "nested" in refused(deep, TWIST)[1]
    assert "nested" in refused({"linear" + ".x" * 900: 1}, TWIST)[1]


def test_constants_by_name_and_array_elements_by_number():
    values = fit_fields(EVERYTHING, {"level": "HIGH", "points.1.y": 2, "points.0.x": 1, "a_int8": 3.0})
    assert values == {"level": 9, "points": [{"x": 1.0}, {"y": 2.0}], "a_int8": 3}


def test_times_are_seconds_or_parts_or_now():
    values = fit_fields(EVERYTHING, {"a_time": 1.25, "a_duration": -0.5, "header": {"stamp": "now"}})
    assert values["a_time"] == {"secs": 1, "nsecs": 250_000_000}
    assert values["a_duration"] == {"secs": -1, "nsecs": 500_000_000}
    assert values["header"] == {"stamp": "now"}
    ends = fit_fields(EVERYTHING, {"a_time": 2**32 - 0.5, "a_duration": -(2**31)})
    assert ends["a_time"] == {"secs": 2**32 - 1, "nsecs": 500_000_000}
    assert ends["a_duration"] == {"secs": -(2**31), "nsecs": 0}


# --- bytes ----------------------------------------------------------------------------------------


def test_missing_fields_are_zero_and_header_stamps_are_now():
    layout = Layout(EVERYTHING)
    fields, _ = layout.read(layout.write({}, (1700000000, 5)), ALL)
    assert fields.pop("header") == {"seq": 0, "stamp": {"secs": 1700000000, "nsecs": 5}, "frame_id": ""}
    assert fields["covariance"] == [0.0, 0.0, 0.0]
    assert fields["points"] == fields["names"] == []
    assert fields["a_time"] == {"secs": 0, "nsecs": 0}
    assert fields["nothing"] == {}


def whole(name: str) -> st.SearchStrategy[int]:
    low, high = INTEGERS[name]
    return st.integers(low, high)


values = st.fixed_dictionaries(
    {},
    optional={
        **{f"a_{name}": whole(name) for name in INTEGERS if name != "bool"},
        "a_bool": st.booleans(),
        "a_float64": st.floats(allow_nan=False, allow_infinity=False),
        "names": st.lists(st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]))),
        "flags": st.lists(st.booleans()),
        "points": st.lists(
            st.fixed_dictionaries({"x": st.floats(-9, 9), "y": st.floats(-9, 9), "z": st.just(0.0)})
        ),
    },
)


@given(values)
def test_written_messages_can_be_read(given):
    layout = Layout(EVERYTHING)
    fields, shortened = layout.read(layout.write(fit_fields(EVERYTHING, given), (0, 0)), ALL)
    assert {name: fields[name] for name in given} == given
    assert shortened == {}


@given(values, st.integers(0, 400))
def test_a_message_that_was_cut_is_broken_not_a_crash(given, left):
    layout = Layout(EVERYTHING)
    data = layout.write(fit_fields(EVERYTHING, given), (0, 0))
    for part in (data[:-1], data + b"\0", data[:left] + b"\xff" * 8):
        try:
            layout.read(part, Detail(4, 2, 10))
        except Broken:
            continue
        assert len(part) != len(data) - 1 and len(part) != len(data) + 1


@given(st.binary(max_size=300))
def test_any_bytes_are_a_message_or_broken(data):
    with suppress(Broken):
        Layout(EVERYTHING).read(data, Detail(4, 2, 10))


def test_long_arrays_and_texts_are_read_in_part():
    layout = Layout(
        [Field("points", "p", array=-1, fields=[Field("name", "string")]), Field("last", "string")]
    )
    data = layout.write({"points": [{"name": "n" * 20}] * 9, "last": "é" * 30}, (0, 0))
    fields, shortened = layout.read(data, Detail(4, 2, 10))
    assert fields == {"points": [{"name": "n" * 10 + "…"}] * 2, "last": "é" * 10 + "…"}
    assert shortened == {"points": 9}


def test_an_array_with_a_false_length_costs_nothing():
    layout = Layout([Field("names", "string", array=-1)])
    with pytest.raises(Broken, match="4294967295 elements"):
        layout.read(b"\xff\xff\xff\xff", ALL)


@pytest.mark.parametrize(
    ("value", "shown"), [(math.nan, "NaN"), (math.inf, "Infinity"), (-math.inf, "-Infinity")]
)
def test_numbers_that_json_does_not_have_are_texts(value, shown):
    layout = Layout([Field("a", "float64")])
    assert layout.read(layout.write({"a": value}, (0, 0)), ALL)[0] == {"a": shown}


def test_a_float32_is_shown_without_digits_that_it_does_not_know():
    layout = Layout([Field("a", "float32")])
    assert layout.read(layout.write({"a": 0.1}, (0, 0)), ALL)[0] == {"a": 0.1}
