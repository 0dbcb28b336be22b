"""Operations that a client sends in fragments. What never becomes whole takes little memory, and not for long. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field

from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.rosbridge.operations import LARGEST_BYTES, Fragment

MOST_OPEN = 8  # operations of one client
PATIENCE_S = 30.0  # from the first fragment of an operation to its last

Key = str | int


@dataclass
class _Open:
    total: int
    since_s: float
    parts: dict[int, str] = field(default_factory=dict)
    size: int = 0


class Reassembly:
    """The fragments of one client."""

    def __init__(self) -> None:
        self._open: dict[Key, _Open] = {}

    def add(self, fragment: Fragment, now_s: float) -> str | None:
        """Take a fragment. Return the operation if it is whole now. Raises `NotDone`: it is dropped."""
        for key in [key for key, one in self._open.items() if now_s - one.since_s > PATIENCE_S]:
            del self._open[key]
        if fragment.id not in self._open and len(self._open) >= MOST_OPEN:
            text = say("At most {most} operations at once are sent in fragments.", most=MOST_OPEN)
            raise NotDone(Refusal("too_many_fragments", text, "wire", {"most": MOST_OPEN}))
        known = self._open.setdefault(fragment.id, _Open(fragment.total, now_s))
        try:
            _require_fits(fragment, known)
        except NotDone:
            del self._open[fragment.id]
            raise
        known.parts[fragment.num] = fragment.data
        known.size += len(fragment.data.encode(errors="replace"))
        if len(known.parts) < known.total:
            return None
        del self._open[fragment.id]
        return "".join(known.parts[number] for number in range(known.total))


def _require_fits(fragment: Fragment, known: _Open) -> None:
    if fragment.total != known.total or fragment.num >= known.total:
        text = say("Fragment {number} does not belong to the fragments before it.", number=fragment.num)
        raise NotDone(Refusal("bad_fragment", text, "wire", {"num": fragment.num, "total": fragment.total}))
    if fragment.num in known.parts:
        text = say("Fragment {number} came twice.", number=fragment.num)
        raise NotDone(Refusal("bad_fragment", text, "wire", {"num": fragment.num}))
    if known.size + len(fragment.data) > LARGEST_BYTES:
        text = say(
            "The message has {bytes} bytes; at most {most} are taken.",
            bytes=known.size + len(fragment.data),
            most=LARGEST_BYTES,
        )
        raise NotDone(Refusal("too_large", text, "wire", {"limit_bytes": LARGEST_BYTES}))
