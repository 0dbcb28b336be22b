"""Why the file of a recording cannot be read."""

from __future__ import annotations

from robots.shared.wire import NotDone, Refusal

OUT_OF_REACH = Refusal(
    "recording_away",
    "The file of this recording cannot be read now: its computer or disk is out of reach.",
    "robot",
)


class FileAway(NotDone):
    """A file that cannot be reached, also in the middle of reading it."""

    def __init__(self, refusal: Refusal = OUT_OF_REACH) -> None:
        super().__init__(refusal)
