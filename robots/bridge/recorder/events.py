"""Notices what the black box keeps, by the robot's state as pages get it. Pure: time is an argument."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.drive.drive_log import Held
from robots.bridge.recorder.contacts import is_contact_name
from robots.shared import wire
from robots.shared.sentences import Sentence, say
from robots.shared.wire import RecordingEvent

HELD_S = 1.0  # the gate: a shorter intervention is everyday driving
AGAIN_S = 30.0  # a sensor or part that fails again sooner is the same fault

Happened = Callable[[RecordingEvent, str, str], None]  # event, text, by whom


class Events:
    """The events of one robot. `happened` is called for each."""

    def __init__(self, happened: Happened) -> None:
        self._happened = happened
        self._fence: int | None = None
        self._stop: int | None = None  # its number
        self._held = 0  # number of the last intervention that was told
        self._online = False
        self._moves = False
        self._ok: dict[str, bool] = {}  # sensors
        self._ill: set[str] = set()  # parts that report an error, or a contact
        self._told_s: dict[str, float] = {}

    def observe(self, state: wire.State, held: Held | None, now_s: float) -> None:
        """Take the present state. While nobody has control only stops count."""
        if state.stop.number != self._stop:
            if self._stop is not None and state.stop.state != "clear":
                by = state.stop.by or ""
                self._happened("stop", say("Stopped by {by}.", by=by) if by else say("Stopped."), by)
            self._stop = state.stop.number
        in_control, begins = state.fence is not None, state.fence != self._fence
        self._fence = state.fence
        if in_control and not begins:
            self._observe_gate(held)
            self._observe_faults(state, now_s)
        else:  # what is so at the beginning is no event
            self._held = held.number if held is not None else self._held
        self._online = state.phase == "online"
        self._moves = state.moves_although_stopped is not None
        self._ok = {sensor.name: sensor.ok for sensor in state.sensors}
        self._ill = {part.name for part in _ill(state)}

    def _observe_gate(self, held: Held | None) -> None:
        if held is not None and held.number != self._held and held.held_s > HELD_S:
            self._held = held.number
            self._happened("gate", held.text, "")

    def _observe_faults(self, state: wire.State, now_s: float) -> None:
        if self._online and state.phase != "online":
            self._tell("fault", "phase", state.text, now_s)
        if state.moves_although_stopped is not None and not self._moves:
            self._tell("fault", "moves", state.moves_although_stopped.text, now_s)
        for sensor in state.sensors:
            if not sensor.ok and self._ok.get(sensor.name):
                self._tell("fault", sensor.name, sensor.text or sensor.name, now_s)
        for part in _ill(state):
            if part.name not in self._ill:
                event: RecordingEvent = "contact" if is_contact_name(part.name) else "fault"
                self._tell(event, part.name, _words(part), now_s)

    def _tell(self, event: RecordingEvent, what: str, text: str, now_s: float) -> None:
        last_s = self._told_s.get(what)
        if last_s is None or now_s - last_s > AGAIN_S:
            self._told_s[what] = now_s
            self._happened(event, text, "")


def _ill(state: wire.State) -> list[wire.HealthPart]:
    """Return the parts that report an error; of a bumper a warning, too."""
    parts = state.health.parts if state.health is not None else []
    return [
        part
        for part in parts
        if part.level == "error" or (part.level == "warning" and is_contact_name(part.name))
    ]


def _words(part: wire.HealthPart) -> Sentence:
    return say("{part}: {text}", part=part.name, text=part.text)
