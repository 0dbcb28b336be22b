"""The inspector's refusals."""

from __future__ import annotations

from robots.shared.wire import Refusal


class Declined(Exception):
    """A request cannot or must not be carried out; `refusal` gives the reason for people."""

    def __init__(self, code: str, text: str, **figures: float | int | str | None) -> None:
        super().__init__(text)
        self.refusal = Refusal(code, text, "robot", figures)
