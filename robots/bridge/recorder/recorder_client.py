"""The bridge's client of its recorder: a process that runs while somebody has control, or a recording goes on.

The bridge waits for nothing: what the chain says is dropped, and counted, if the process does not take it in time.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol
from uuid import UUID, uuid4

import msgspec
from msgspec import Struct, structs

from robots.bridge.audit.records import Records
from robots.bridge.drive.drive_log import Held
from robots.bridge.recorder.black_box.events import Events
from robots.bridge.recorder.recorder_messages import (
    COMMAND,
    EVENT,
    VERDICT,
    VIEW,
    Begin,
    Begun,
    ChainEvent,
    Command,
    Continued,
    End,
    Finished,
    Happened,
    InControl,
    Kept,
    Lost,
    Over,
    Progress,
    RecorderReport,
    Removed,
    Said,
    Stored,
    goes_on,
)
from robots.bridge.topics.line_process import LineProcess
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import side_command
from robots.shared.records.record_sink import TakenRecording
from robots.shared.sentences import say
from robots.shared.wire import BlackBoxState, RecordingState, Refusal

log = logging.getLogger(__name__)

SILENCE_S = 5.0  # a process without a sign of life for this time hangs: it is killed, and another one starts
START_S = 20.0  # the same for a new process
ANSWER_S = 10.0  # a recording begins within this time, or is refused
LINGER_S = 60.0  # until an unused process ends
LOOK_S = 60.0  # an unneeded process lives so long, to finish and report the files of an earlier one
VIEW_GAP_S = 0.09  # between two views
MOST_SAID = 2000  # messages that wait for the next tick
MOST_WAITING = 500  # requests that wait for a process that reads slowly

NO_RECORDINGS = Refusal(
    "no_recordings", "Recordings are switched off on the computer of this robot’s bridge.", "robot"
)
NOT_GOING = Refusal("no_recording", "This recording does not go on.", "robot")
NO_BOX = Refusal(
    "no_black_box", "Nothing can be kept: the black box runs only while somebody has control.", "robot"
)
_SILENT = Refusal("recorder_silent", "The robot’s recorder did not answer in time: try again.", "robot")
_ENDED = Refusal("recorder_ended", "The robot’s recorder ended by itself. It is started again.", "robot")

Answer = Callable[[Refusal | None], None]
_report = msgspec.json.Decoder(RecorderReport)


class Judge(Protocol):
    """The part that knows the gate's answer to the last command."""

    @property
    def verdict(self) -> wire.Verdict: ...


class RecorderClient:
    """The recorder of one robot, on the event loop."""

    def __init__(self, config: BridgeConfig, records: Records, command: Sequence[str] = ()) -> None:
        self._place = config.recordings
        self._records = records
        self._child = LineProcess(
            command or side_command(config.ros, "recorder"), msgspec.json.encode(config), self
        )
        self._events = Events(self._happened)
        self._control: wire.Grant | None = None
        self._order: tuple[wire.LinkRecord, float] | None = None  # and when it ends (s, monotonic)
        self._present: UUID | None = None  # the file that the order writes now
        self._answer: tuple[Answer, asyncio.TimerHandle] | None = None
        self._keeping: dict[int, tuple[Answer, asyncio.TimerHandle]] = {}  # by the time of the event
        self._said: deque[tuple[str, int, Struct]] = deque()
        self._viewed_s = float("-inf")
        self._needed_until_s = float("-inf")
        self._heard_s = float("-inf")
        self._waiting: deque[bytes] = deque()  # requests
        self._lost: Counter[str] = Counter()  # messages, by topic: the process does not know it yet
        self._recording: RecordingState | None = None
        self._black_box: BlackBoxState | None = None
        self._storing: set[UUID] = set()
        self._closing = False

    async def begin(self) -> None:
        """Look for files of an earlier process that are not finished, or have no row. A disk may hang: nobody waits."""
        if self._place is not None and await asyncio.to_thread(_has_leftovers, Path(self._place.directory)):
            self._stay(LOOK_S)

    async def close(self) -> None:
        """End the process: the bridge ends. Rows of the files that it finishes now are stored at the next start."""
        self._closing = True
        self._flush()
        await self._child.close()

    # --- requests ------------------------------------------------------------------------------------

    def record(self, order: wire.LinkRecord, answer: Answer, now_s: float) -> None:
        """Begin a recording; `answer` is called once."""
        if self._place is None:
            answer(NO_RECORDINGS)
        elif self._order is not None:
            answer(goes_on(self._order[0].by, self._present or order.recording))
        else:
            timer = asyncio.get_running_loop().call_later(ANSWER_S, self._unanswered)
            self._answer = answer, timer
            self._begin(order, now_s + order.seconds, None)

    def end(self, recording: UUID) -> Refusal | None:
        """End a recording: by its own number, or by that of the request that it continues."""
        if self._order is None or recording not in (self._order[0].recording, self._present):
            return NOT_GOING
        self._send(End(self._present or recording))
        self._order = None
        return None

    def keep(self, order: wire.LinkKeep, answer: Answer) -> None:
        """Keep what was before now; `answer` is called once."""
        if self._place is None:
            answer(NO_RECORDINGS)
        elif self._black_box is None:
            answer(NO_BOX)
        elif not self._child.listens:
            answer(_ENDED)
        else:
            at_ns = time.monotonic_ns()
            timer = asyncio.get_running_loop().call_later(ANSWER_S, self._kept, at_ns, _SILENT)
            self._keeping[at_ns] = answer, timer
            self._keep(order, at_ns)

    def _keep(self, order: wire.LinkKeep, at_ns: int) -> None:
        text = say("{by} kept this: {reason}", by=order.by, reason=order.reason) if order.reason else ""
        text = text or say("{by} kept this.", by=order.by)
        self._send(Happened("keep", at_ns, text, order.by, order.person))
        self._say(EVENT, ChainEvent("keep", text, order.by))

    def _kept(self, at_ns: int, refusal: Refusal | None) -> None:
        if at_ns in self._keeping:
            answer, timer = self._keeping.pop(at_ns)
            timer.cancel()
            answer(refusal)

    # --- what the bridge tells ------------------------------------------------------------------------

    def tick(self, grant: wire.Grant | None, now_s: float) -> None:
        """Follow who has control; write what was said."""
        if self._place is None:
            return
        before = self._control
        if grant is not before and (grant and grant.fence) != (before and before.fence):
            self._control = grant
            if grant is not None:
                self._stay(LINGER_S)
                self._child.need()
            self._send(_in_control(grant))
            event = "control_ends" if grant is None else "control_begins"
            self._say(EVENT, ChainEvent(event, by=(grant or before or _NOBODY).holder))
        if not self._child.listens:
            self._let_go(now_s)
        if self._needs:
            self._needed_until_s = max(self._needed_until_s, now_s + LINGER_S)
        elif self._child.listens and now_s >= self._needed_until_s:
            self._child.close_input()
        if self._child.listens and now_s - self._heard_s > SILENCE_S:
            self._heard_s = now_s + START_S
            self._child.kill("it shows no sign of life")
        self._flush()

    @property
    def wants_view(self) -> bool:
        """Return whether views must be made although nobody looks. The box goes on for a while after control."""
        return self._place is not None and (self._needs or self._black_box is not None)

    def observe(self, state: wire.State, held: Held | None, now_s: float) -> None:
        """Notice events in the robot's state."""
        if self._place is not None:
            self._events.observe(state, held, now_s)

    def view(self, view: wire.View, held: Held | None, now_s: float) -> None:
        """Take a view: it is written, and events are noticed in it."""
        self.observe(view.state, held, now_s)
        if now_s - self._viewed_s >= VIEW_GAP_S:
            self._viewed_s = now_s
            self._say(VIEW, view)

    def command(self, drive: wire.Drive, refusal: Refusal | None, judge: Judge) -> None:
        """Write a stick position, its refusal, and the gate's answer."""
        if self.wants_view:
            self._say(COMMAND, Command(drive, refusal))
            if refusal is None:
                self._say(VERDICT, judge.verdict)

    def refused(self, refusal: Refusal, kind: str) -> None:
        """Write a refusal of any other request."""
        if self.wants_view:
            text = f"{kind}: {refusal.text}"
            self._say(EVENT, ChainEvent("refused", text, code=refusal.code, figures=refusal.figures))

    def state(self) -> dict[str, Any]:
        """Return the fields of `wire.State` that the recorder knows."""
        return {"recording": self._recording, "black_box": self._black_box}

    # --- inside ---------------------------------------------------------------------------------------

    def _happened(self, event: wire.RecordingEvent, text: str, by: str) -> None:
        if self._place is not None:
            self._send(Happened(event, time.monotonic_ns(), text, by))
            self._say(EVENT, ChainEvent(event, text, by))

    def _begin(self, order: wire.LinkRecord, ends_s: float, continues: UUID | None) -> None:
        self._order, self._present = (order, ends_s), order.recording
        self._stay(LINGER_S)
        if not self._child.listens:
            self._child.need()  # `began` sends it
        else:
            self._send(Begin(order, continues))

    def _say(self, topic: str, message: Struct) -> None:
        if self._child.listens:
            if len(self._said) >= MOST_SAID:
                self._lost[self._said.popleft()[0]] += 1
            self._said.append((topic, time.monotonic_ns(), message))

    def _flush(self) -> None:
        """Write what was said since the last tick, in one write."""
        self._send_waiting()
        if not self._said and not self._lost:
            return
        lines = [wire.encode(Lost(topic, count)) for topic, count in self._lost.items()]
        for topic, at_ns, message in self._said:
            lines.append(wire.encode(Said(topic, at_ns, msgspec.Raw(wire.encode(message)))))
        if self._child.offer(b"\n".join(lines)):
            self._lost.clear()
        else:
            if not self._lost:
                log.warning("messages are dropped: the recorder does not read them")
            self._lost.update(topic for topic, _, _ in self._said)
        self._said.clear()

    def _send(self, message: Struct) -> None:
        """Send a request: it waits for a process that reads slowly."""
        if self._child.listens:
            self._waiting.append(wire.encode(message))
            self._send_waiting()

    def _send_waiting(self) -> None:
        while self._waiting and self._child.offer(self._waiting[0]):
            self._waiting.popleft()
        if len(self._waiting) > MOST_WAITING:
            self._child.kill("it does not read its input")

    def _stay(self, seconds: float) -> None:
        self._needed_until_s = max(self._needed_until_s, time.monotonic() + seconds)
        self._child.need()

    def _unanswered(self) -> None:
        self._order = None
        if self._present is not None:
            self._send(End(self._present))  # it may begin after all
        self._answered(_SILENT)

    def _answered(self, refusal: Refusal | None) -> None:
        if self._answer is not None:
            answer, timer = self._answer
            self._answer = None
            timer.cancel()
            answer(refusal)

    @property
    def _needs(self) -> bool:
        return self._control is not None or self._order is not None

    # --- the process (line_process.LineProcessOwner) ----------------------------------------------

    def needed(self) -> bool:
        """Return whether to keep the process."""
        return self._needs or time.monotonic() < self._needed_until_s

    def began(self) -> None:
        """Tell a new process who has control, and what it records."""
        now_s = time.monotonic()
        self._heard_s = now_s + START_S - SILENCE_S
        if self._control is not None:
            self._send(_in_control(self._control))
        self._let_go(now_s)
        if self._order is not None:
            order, ends_s = self._order
            continues = self._present if self._answer is None else None
            if continues is not None:
                order = structs.replace(order, recording=uuid4())
            self._present = order.recording
            self._send(Begin(structs.replace(order, seconds=ends_s - now_s), continues))

    def _let_go(self, now_s: float) -> None:
        """Forget a recording whose time was over while no process was there."""
        if self._order is not None and now_s >= self._order[1]:
            self._order = self._recording = None
            self._answered(_SILENT)

    def handle_line(self, line: bytes) -> None:
        """Take a report."""
        self._heard_s = time.monotonic()
        match _report.decode(line):
            case Progress(recording=recording, black_box=black_box):
                self._progressed(recording, black_box)
            case Begun(recording=recording, refusal=refusal) if recording == self._present:
                if refusal is not None:
                    self._order = None
                    if self._answer is None and self._recording is not None:  # it went on in a new process
                        self._recording = structs.replace(self._recording, refusal=refusal)
                self._answered(refusal)
            case Kept(at_ns=at_ns, refusal=refusal):
                self._kept(at_ns, refusal)
            case Continued(recording=recording, by=following) if recording == self._present:
                self._present = following
            case Over(recording=recording) if recording == self._present:
                self._order = None
            case Finished(taken=taken):
                self._store(taken)
            case Removed(recording=recording) if not self._closing:
                self._records.drop_recording(recording)

    def _progressed(self, recording: RecordingState | None, black_box: BlackBoxState | None) -> None:
        """Take what goes on. A new process says nothing before it has read its requests."""
        if recording is not None:
            self._recording = recording
        elif self._order is None:
            self._recording = None
        if black_box is not None or self._control is None:
            self._black_box = black_box

    def _store(self, taken: TakenRecording) -> None:
        """Let the row be stored. The recorder reports the file again until this is done."""
        if taken.recording in self._storing or self._closing:
            return
        self._storing.add(taken.recording)
        loop = asyncio.get_running_loop()

        def done(is_stored: bool) -> None:
            self._storing.discard(taken.recording)
            if is_stored:
                self._send(Stored(taken.recording))

        def stored(is_stored: bool) -> None:
            with contextlib.suppress(RuntimeError):  # the bridge has ended
                loop.call_soon_threadsafe(done, is_stored)

        self._records.keep_recording(taken, stored)

    def ended(self) -> None:
        """Note that the process ended. What it recorded is finished by the next one."""
        ended = _ENDED if self._needs else None
        self._said.clear()
        self._lost.clear()
        self._waiting.clear()
        for at_ns in list(self._keeping):
            self._kept(at_ns, _ENDED)
        if self._recording is not None:
            self._recording = structs.replace(self._recording, refusal=ended) if ended else None
        if self._black_box is not None:
            self._black_box = BlackBoxState(refusal=ended) if ended else None


_NOBODY = wire.Grant(1, 1.0, "", "", "", 1.0)


def _in_control(grant: wire.Grant | None) -> InControl:
    return InControl() if grant is None else InControl(grant.holder_id, grant.session)


def _has_leftovers(directory: Path) -> bool:
    try:
        return any(path.suffix in (".part", ".new") for path in directory.iterdir())
    except OSError:
        return False
