"""Definitions and bytes that would need endless time or memory are refused quickly, with a text."""

import time

import pytest

from robots.shared.messages.packing import MAX_STEPS, MAX_WRITTEN_BYTES, Detail, Layout, TooLarge
from robots.shared.wire import Field

DETAIL = Detail(whole=32, first=16, text=500)
SOON_S = 5.0  # on a busy machine; without limits, reading takes minutes or never ends


def nested(array, depth):
    """Nested arrays of messages; the innermost message has no fields."""
    fields = []
    for _ in range(depth):
        fields = [Field("a", "e/T", array=array, fields=fields)]
    return fields


def test_zero_byte_elements_are_read_once():
    shown, shortened = Layout(nested(32, 5)).read(b"", DETAIL)
    assert shown == {"a": [{"a": [{"a": [{"a": [{"a": [{}]}]}]}]}]}
    assert shortened["a"] == 32


def test_a_message_of_too_many_parts_is_not_read_to_its_end():
    empties = [Field(f"e{number}", "e/None") for number in range(1000)]
    parts = Field("parts", "e/Part", array=-1, fields=[Field("text", "string"), *empties])
    count = 1_000_000
    data = count.to_bytes(4, "little") + bytes(4 * count)
    began_s = time.monotonic()
    with pytest.raises(TooLarge, match="too many parts"):
        Layout([parts]).read(data, DETAIL)
    assert time.monotonic() - began_s < SOON_S


def test_parts_of_no_bytes_count_where_they_are_shown():
    empties = [Field(f"e{number}", "e/None") for number in range(1000)]
    inner = Field("inner", "e/Inner", array=-1, fields=[Field("text", "string"), *empties])
    outer = Field("outer", "e/Outer", array=-1, fields=[inner])
    count = (32).to_bytes(4, "little")
    data = count + 32 * (count + bytes(4 * 32))
    with pytest.raises(TooLarge, match="too many parts"):
        Layout([outer]).read(data, DETAIL)


def test_a_large_message_of_few_parts_is_read():
    texts = Field("texts", "string", array=-1)
    count = MAX_STEPS // 3
    shown, _ = Layout([texts]).read(count.to_bytes(4, "little") + bytes(4 * count), DETAIL)
    assert shown == {"texts": [""] * DETAIL.first}


def test_few_given_elements_that_mean_many_bytes_are_not_written():
    row = Field("row", "e/Row", array=-1, fields=[Field("cells", "float64", array=100_000)])
    began_s = time.monotonic()
    with pytest.raises(TooLarge, match=f"more than {MAX_WRITTEN_BYTES} bytes"):
        Layout([row]).write({"row": [{}] * 5000}, (0, 0))
    assert time.monotonic() - began_s < SOON_S


def test_given_elements_of_no_bytes_take_no_time():
    fields = [Field("row", "e/Row", array=-1, fields=nested(100_000, 1))]
    began_s = time.monotonic()
    assert Layout(fields).write({"row": [{}] * 5000}, (0, 0)) == (5000).to_bytes(4, "little")
    assert time.monotonic() - began_s < SOON_S
