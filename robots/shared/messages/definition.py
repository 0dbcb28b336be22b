"""The definition of a type: how its messages are called, described and serialized. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from robots.shared.messages.packing import Layout
from robots.shared.messages.serialization import ROS1, Serialization
from robots.shared.messages.whole import Encode, cbor_encoder, json_encoder
from robots.shared.wire import Field


@dataclass(frozen=True)
class Definition:
    """One type at one version. `known`: from an installed package, else from a publisher."""

    type: str
    md5: str  # of ROS 1; in ROS 2 the type hash, "" before Iron
    text: str  # followed by the embedded types' texts, as in a bag
    known: bool
    fields: list[Field] = field(repr=False)
    serialization: Serialization = ROS1

    @cached_property
    def layout(self) -> Layout:
        """The byte layout of its messages, for what people read and write."""
        return Layout(self.fields, self.serialization)

    @cached_property
    def json(self) -> Encode:
        """The encoder of whole messages to JSON."""
        return json_encoder(self.fields, self.serialization)

    @cached_property
    def cbor(self) -> Encode:
        """The encoder of whole messages to CBOR."""
        return cbor_encoder(self.fields, self.serialization)
