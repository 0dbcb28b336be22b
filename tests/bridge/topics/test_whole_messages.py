"""Whole messages in JSON and CBOR: as rosbridge writes them, and within limits."""

from __future__ import annotations

import json
import struct

import cbor2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robots.shared.messages.packing import Broken, Detail, Layout, TooLarge
from robots.shared.messages.serialization import CDR
from robots.shared.messages.whole import cbor_encoder, json_encoder
from robots.shared.wire import Field

FLOATS = [Field("data", "float32", -1)]
EMPTY = [Field("data", "lab_msgs/Nothing", -1)]
NAMES = [Field("data", "string", -1)]


def array(values):
    packed = np.asarray(values, dtype="<f4").tobytes()
    return struct.pack("<I", len(values)) + packed


@given(st.lists(st.floats(width=32), max_size=50))
@example([0.0, -0.0, 1e-45, 3.4028234663852886e38, 16777216.0, 0.1, float("nan"), float("-inf")])
def test_a_float_in_json_is_the_same_float(values):
    shown = json.loads(json_encoder(FLOATS)(array(values)))["data"]
    finite = [value if np.isfinite(value) else None for value in values]
    assert [None if one is None else np.float32(one) for one in shown] == finite


def test_a_float_in_json_has_few_digits():
    assert json_encoder(FLOATS)(array([0.1, 23.457, -1.5e-3, 100000.0])) == (
        b'{"data":[0.1,23.457,-0.0015,100000.0]}'
    )


def test_a_message_that_ends_early_is_broken():
    with pytest.raises(Broken):
        json_encoder(FLOATS)(array([1.0, 2.0])[:-1])
    with pytest.raises(Broken):
        cbor_encoder(FLOATS)(array([1.0]) + b"x")


@pytest.mark.parametrize("definition", [EMPTY, NAMES])
def test_a_length_alone_costs_nothing(definition):
    for encoder in (json_encoder, cbor_encoder):
        with pytest.raises(TooLarge):
            encoder(definition)(b"\xff\xff\xff\xff")


def test_points_and_times():
    point = Field("at", "geometry_msgs/Point32", -1, fields=[Field(name, "float32") for name in "xyz"])
    definition = [Field("when", "time"), point, Field("ok", "bool", 2), Field("__class__", "uint64")]
    data = struct.pack("<II I6f 2? Q", 7, 9, 2, 1, 2, 3, 4, 5, 6, True, False, 2**63)
    wanted = {
        "when": {"secs": 7, "nsecs": 9},
        "at": [{"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 4.0, "y": 5.0, "z": 6.0}],
        "ok": [True, False],
        "__class__": 2**63,
    }
    assert json.loads(json_encoder(definition)(data)) == wanted
    assert cbor2.loads(cbor_encoder(definition)(data)) == wanted


def test_numbers_of_cdr_begin_at_multiples_of_their_width():
    point = Field("at", "lab_msgs/Mark", -1, fields=[Field("on", "bool"), Field("x", "float64")])
    definition = [
        Field("name", "string"),
        Field("when", "builtin_interfaces/Time"),
        point,
        Field("n", "uint16"),
    ]
    data = b"\0\1\0\0" + struct.pack(
        "<I2s 2x iI I ?3x d ?7x d H", 2, b"a\0", -7, 9, 2, True, 1.5, False, -2.5, 65535
    )
    wanted = {
        "name": "a",
        "when": {"sec": -7, "nanosec": 9},
        "at": [{"on": True, "x": 1.5}, {"on": False, "x": -2.5}],
        "n": 65535,
    }
    everything = Detail(whole=10, first=10, text=10)
    assert Layout(definition, CDR).read(data, everything) == (wanted, {})
    assert Layout(definition, CDR).write(wanted, (0, 0)) == data
    for after in (b"", b"unwritten"):  # Fast DDS may send more bytes than it wrote
        assert json.loads(json_encoder(definition, CDR)(data + after)) == wanted
    for broken in (b"", b"\0\1", data[:-1], b"\0\0" + data[2:]):  # the last: numbers of the other byte order
        with pytest.raises(Broken):
            json_encoder(definition, CDR)(broken)
        with pytest.raises(Broken):
            Layout(definition, CDR).read(broken, everything)
