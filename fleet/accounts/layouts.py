"""Layouts of the control page at a desk: which pictures are side by side, and what is beside them."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from robots.shared.sentences import say

Panel = Literal["chart", "motions", "phrases"]
# A plot has a topic and up to six of its fields: "plot /odom pose.x pose.y".
CELL = r"^(camera|plan|map|scene|second|plot( /[A-Za-z0-9_/]{1,200}( [A-Za-z0-9_.\[\]]{1,200}){0,6})?)$"


class Layout(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The contents of the pictures, the largest first, and what is beside them.

    `cells`: none for the page’s own views. `side`: motions and phrases are shown. `stick`: so is the stick. `panels`:
    the panel above the stick, and those at the other side, above and below.
    """

    cells: Annotated[list[Annotated[str, Meta(pattern=CELL, max_length=500)]], Meta(max_length=4)]
    side: bool = True
    stick: bool = True
    panels: tuple[Panel, Panel, Panel] = ("chart", "motions", "phrases")

    def __post_init__(self) -> None:
        pictures = [cell for cell in self.cells if not cell.startswith("plot")]
        if len(set(pictures)) < len(pictures):
            raise ValueError(say("Only plots may be in two places of a layout."))
        if len(set(self.panels)) < len(self.panels):
            raise ValueError(say("Each panel needs a place of its own."))
