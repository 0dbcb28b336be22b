"""Notices what the black box keeps, by the robot's state as pages get it. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.drive.drive_log import Held
from robots.bridge.recorder.black_box.contacts import is_contact_name
from robots.shared import wire
from robots.shared.sentences import Sentence, say
from robots.shared.wire import RecordingEvent

HELD_S = 1.0  # the gate: a shorter intervention is everyday driving
LASTS_S = 1.0  # a shorter silence stops a drive, but is no fault to look at
AGAIN_S = 30.0  # a sensor or part that fails again sooner is the same fault

Happened = Callable[[RecordingEvent, str, str], None]  # event, text, by whom


class Events:
    """The events of one robot. `happened` is called for each."""

    def __init__(self, happened: Happened) -> None:
        self._happened = happened
        self._fence: int | None = None
        self._stop: int | None = None  # its number
        self._held = 0  # number of the last intervention that was told
        self._well: set[str] = set()  # what was well in this control
        self._since_s: dict[str, float] = {}  # what is not, since when
        self._ill: set[str] | None = None  # parts that were ill at the last look in this control
        self._told_s: dict[str, float] = {}

    def observe(self, state: wire.State, held: Held | None, now_s: float) -> None:
        """Take the present state. While nobody has control only stops count."""
        if state.stop.number != self._stop:
            if self._stop is not None and state.stop.state != "clear":
                by = state.stop.by or ""
                self._happened("stop", say("Stopped by {by}.", by=by) if by else say("Stopped."), by)
            self._stop = state.stop.number
        if state.fence is None or state.fence != self._fence:  # what is so at the beginning is no event
            self._held = held.number if held is not None else self._held
            self._well.clear()
            self._since_s.clear()
            self._ill = None
        self._fence = state.fence
        if state.fence is not None:
            self._observe_gate(held)
            self._observe_faults(state, now_s)

    def _observe_gate(self, held: Held | None) -> None:
        if held is not None and held.number > self._held and held.held_s > HELD_S:
            self._held = held.number
            self._happened("gate", held.text, "")

    def _observe_faults(self, state: wire.State, now_s: float) -> None:
        moves = state.moves_although_stopped
        self._fault("phase", None if state.phase == "online" else state.text, now_s)
        self._fault("moves", moves.text if moves is not None else None, now_s)
        for sensor in state.sensors:
            text = None if sensor.ok else say("{part}: {text}", part=sensor.name, text=sensor.text)
            self._fault(f"sensor {sensor.name}", text, now_s)
        ill = _ill(state)
        for name in ill.keys() - (ill.keys() if self._ill is None else self._ill):
            self._tell("contact" if is_contact_name(name) else "fault", name, ill[name], now_s)
        self._ill = set(ill)

    def _fault(self, what: str, text: str | None, now_s: float) -> None:
        """Note that this is well (None), or why it is not: a fault if it was well before, and is not for a while."""
        if text is None:
            self._well.add(what)
            self._since_s.pop(what, None)
        elif what in self._well and now_s - self._since_s.setdefault(what, now_s) >= LASTS_S:
            self._well.discard(what)
            self._tell("fault", what, text, now_s)

    def _tell(self, event: RecordingEvent, what: str, text: str, now_s: float) -> None:
        if now_s - self._told_s.get(what, float("-inf")) > AGAIN_S:
            self._told_s[what] = now_s
            self._happened(event, text, "")


def _ill(state: wire.State) -> dict[str, Sentence]:
    """Return the parts that report an error; of a bumper a warning, too."""
    parts = state.health.parts if state.health is not None else []
    return {
        part.name: say("{part}: {text}", part=part.name, text=part.text)
        for part in parts
        if part.level == "error" or (part.level == "warning" and is_contact_name(part.name))
    }
