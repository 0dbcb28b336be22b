"""How the inspector says no."""

from __future__ import annotations

from robots.wire import Refusal


class Declined(Exception):
    """Something cannot be shown, or must not be done; `refusal` is for people."""

    def __init__(self, code: str, text: str, **figures: float | int | str | None) -> None:
        super().__init__(text)
        self.refusal = Refusal(code, text, "robot", figures)
