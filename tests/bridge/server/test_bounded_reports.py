"""The bridge's reports fit into the link's messages, whatever the robot reports."""

from __future__ import annotations

from typing import Any
from uuid import UUID

import msgspec
import pytest
from msgspec import inspect

from robots.shared import wire

TEXT = "\x01" * 1500  # six bytes each in JSON
ENTRIES = 150


def largest(kind: inspect.Type) -> Any:
    """A value of this type, as large as a test has time for."""
    match kind:
        case inspect.StrType():
            return TEXT
        case inspect.IntType():
            return -(2**63)
        case inspect.FloatType():
            return -1.2345678901234567e-300
        case inspect.BoolType():
            return False
        case inspect.LiteralType(values=values):
            return max(values, key=lambda value: len(str(value)))
        case inspect.ListType(item_type=inspect.LiteralType(values=values)):
            return list(values)
        case inspect.ListType(item_type=item):
            return [largest(item)] * ENTRIES
        case inspect.TupleType(item_types=items):
            return tuple(map(largest, items))
        case inspect.DictType(value_type=inspect.ListType(item_type=inspect.AnyType())):  # Said
            return {"text": [TEXT, {"name": TEXT}, TEXT]}
        case inspect.DictType(key_type=inspect.LiteralType(values=keys), value_type=value):
            return {key: largest(value) for key in keys}
        case inspect.DictType(value_type=value):
            return {f"{number}{TEXT}": largest(value) for number in range(ENTRIES)}
        case inspect.StructType(cls=cls, fields=fields):
            return cls(**{field.name: largest(field.type) for field in fields})
        case inspect.UnionType(types=kinds):
            return max((largest(one) for one in kinds), key=lambda value: len(msgspec.json.encode(value)))
        case inspect.UUIDType():
            return UUID(int=2**128 - 1)
        case inspect.NoneType():
            return None
    raise AssertionError(f"what is the largest {kind}?")


@pytest.mark.parametrize(
    "kind", [wire.Status, wire.Offers, wire.View, wire.Refused, wire.BridgeHello, wire.Stopped]
)
def test_the_largest_report_fits_and_is_understood(kind: type[msgspec.Struct]) -> None:
    if kind is wire.Stopped:
        report: msgspec.Struct = wire.Stopped(largest(inspect.type_info(wire.StopState)))
    else:
        report = largest(inspect.type_info(kind))
    encoded = wire.encode_report(report)
    assert len(encoded) <= wire.LARGEST_REPORT_BYTES
    assert isinstance(msgspec.json.decode(encoded, type=kind), kind)


def test_a_report_that_fits_is_said_as_it_is() -> None:
    offers = wire.Offers([wire.MotionOffer("wave", "Wave", description="x" * 3000)])
    assert wire.encode_report(offers) == wire.encode(offers)


def test_missing_items_are_counted() -> None:
    offers = wire.Offers(
        [wire.MotionOffer("wave", "Wave", description="x" * 3_000_000)], languages=["en"] * 300_000
    )
    decoded = msgspec.json.decode(wire.encode_report(offers), type=wire.Offers)
    assert decoded.motions[0].description.endswith("… (3000000 long)")
    assert decoded.languages[-1] == "and 299001 more"
