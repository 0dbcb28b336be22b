"""One recording while it is written: a thread writes what others put, and a slow disk delays nobody else."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from uuid import UUID

from msgspec import structs

from robots.bridge.recorder.black_box.ring import Message, Origin
from robots.bridge.recorder.clock import RecordingClock
from robots.bridge.recorder.files.directory import Draft, NoRoom, RecordingDirectory, refusal_of
from robots.bridge.recorder.files.mcap_file import CHUNK_BYTES, MOST_CHANNELS, McapFile
from robots.bridge.recorder.files.thumbnail import thumbnail_of
from robots.shared import wire
from robots.shared.records.record_sink import ABOUT, KeptEvent, RecordedTopic, ShownControl, TakenRecording
from robots.shared.wire import RecordingEvent, Refusal

log = logging.getLogger(__name__)

FLUSH_S = 1.0  # what is lost if the computer loses its power
MOST_WAITING_BYTES = 24 * 1024 * 1024  # in memory, for the disk
MOST_EVENTS = 500  # that are noted: they are in the row, too
MOST_PICTURES = 8  # topics, of which one becomes the small picture beside the file
MOST_INDEX_BYTES = 32 * 1024 * 1024  # of the index in memory: a file with more of it is opened slowly
SLOW_S = 3.0  # a disk that takes longer for a second of data is too slow
SCHEMAS = {
    "ros1": "ros1msg",
    "cdr": "ros2msg",
    "json": "jsonschema",
}  # encodings of definitions, by that of messages
DROPPED, CLOCK = "fleet_dropped", "fleet_clock"  # names of metadata, besides `ABOUT`

FAILED = Refusal(
    "recorder_failed", "The recording broke: the log of the robot’s bridge has the reason.", "robot"
)
DISK_SLOW = Refusal("disk_slow", "The disk for recordings is too slow: messages are missing.", "limits")


class Take:
    """A recording that goes on. `put` and `end` may be called on any thread, and never wait.

    `opened` is called on the writer's thread when its file exists. `done` is called there once: with the finished
    recording, or with why there is none. A file that cannot be finished now stays a cut file, which `finished_files`
    finishes later. `removed` gets what the quota removed.
    """

    def __init__(
        self,
        directory: RecordingDirectory,
        about: TakenRecording,
        clock: RecordingClock,
        done: Callable[[Take, TakenRecording | Refusal], None],
        removed: Callable[[UUID], None],
        opened: Callable[[], None] = lambda: None,
        profile: str = "ros1",
    ) -> None:
        self.about = about
        self._profile = profile
        self.bytes = 0
        self.index_bytes = 0
        self.dropped: Counter[Origin] = Counter()
        self.refusal: Refusal | None = None  # why it ended by itself
        self.free_bytes: int | None = None
        self._directory = directory
        self._clock = clock
        self._done = done
        self._removed = removed
        self._opened = opened
        self.is_open = False
        self._controls: list[tuple[int, str]] = []  # changes of control: when, and the session
        self._lock = threading.Condition()
        self._first: deque[Message] = deque()
        self._waiting: deque[Message] = deque()
        self._waiting_bytes = 0
        self._ending = False
        self._written_s = time.monotonic()
        self._counts: Counter[Origin] = Counter()
        self._channels: dict[Origin, int] = {}
        self._told_dropped = 0
        self._pictures: dict[str, Message] = {}  # by topic: the one that shows the event best
        self._begins_ns = self._ends_ns = 0
        self._thread = threading.Thread(target=self._run, name=f"take {about.kind}", daemon=True)

    def start(self, first: Iterable[Message] = ()) -> None:
        """Begin with these messages: they may be more than may wait later."""
        self._first.extend(first)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Write a message soon. It is dropped, and counted, if too many wait."""
        with self._lock:
            if self._ending:
                return
            if self._waiting and self._waiting_bytes + message.size > MOST_WAITING_BYTES:
                self.dropped[message.origin] += 1
                return
            self._waiting.append(message)
            self._waiting_bytes += message.size

    def missed(self, origin: Origin, count: int) -> None:
        """Count messages that were lost on their way here."""
        with self._lock:
            self.dropped[origin] += count

    def mark(self, event: RecordingEvent, at_ns: int, text: str, by: str) -> None:
        """Note an event."""
        with self._lock:
            kept = KeptEvent(event, self._clock.log_ns(at_ns) / 1e9, text, by)
            if len(self.about.events) < MOST_EVENTS:
                self.about = structs.replace(self.about, events=[*self.about.events, kept])

    def control(self, at_ns: int, session: str) -> None:
        """Note that this control session began; empty: the one before ended."""
        with self._lock:
            self._controls.append((at_ns, session))

    def leave_out(self, count: int) -> None:
        """Note that so many topics are not in it."""
        with self._lock:
            self.about = structs.replace(self.about, left_out=max(self.about.left_out, count))

    def end(self, why: str = "") -> None:
        """Finish it. `why`: in English, if nobody asked for it."""
        with self._lock:
            self.about = structs.replace(self.about, ended_by=self.about.ended_by or why)
            self._ending = True
            self._lock.notify()

    def join(self, within_s: float) -> bool:
        """Wait until it is finished. Return False if the disk takes longer."""
        self._thread.join(within_s)
        return not self._thread.is_alive()

    @property
    def is_full(self) -> bool:
        """Whether what follows belongs into another file."""
        return self.index_bytes >= MOST_INDEX_BYTES

    @property
    def trouble(self) -> Refusal | None:
        """Why it does not write now."""
        if self.refusal is not None:
            return self.refusal
        return DISK_SLOW if time.monotonic() - self._written_s > SLOW_S else None

    # --- on the writer's thread ----------------------------------------------------------------------

    def _run(self) -> None:
        result: TakenRecording | Refusal
        try:
            self._directory.prepare()
            self._make_room()
            draft = self._directory.begin(self.about.kind, self.about.recording, self.about.begins)
        except NoRoom as full:
            self.refusal = result = full.refusal
        except OSError as error:
            self.refusal = result = refusal_of(error)
        else:
            self.is_open = True
            self._opened()
            try:
                result = self._write(draft)
            except Exception:
                log.exception("%s broke", draft.path.name)
                self.refusal = result = FAILED
        self._done(self, result)

    def _make_room(self) -> None:
        waiting = self._waiting_bytes + sum(message.size for message in self._first)
        for removed in self._directory.make_room(CHUNK_BYTES + waiting):
            self._removed(removed)

    def _write(self, draft: Draft) -> TakenRecording | Refusal:
        file = McapFile(draft.stream, self._profile)
        try:
            file.metadata(ABOUT, {"taken": wire.encode(self.about).decode()})
            while not self._step(file, draft):
                pass
        except NoRoom as full:
            self.refusal = full.refusal
            if not self._counts:
                self._directory.discard(draft)
                return self.refusal
        except OSError as error:
            self.refusal = refusal_of(error)
            log.warning("%s: %s", draft.path.name, error)
            with suppress(OSError):
                draft.stream.close()  # `recovery` may finish it
            return self.refusal
        try:
            return self._finish(file, draft)
        except OSError as error:
            self.refusal = refusal_of(error)
            with suppress(OSError):
                draft.stream.close()
            return self.refusal

    def _step(self, file: McapFile, draft: Draft) -> bool:
        """Write what came within `FLUSH_S`. Return whether it was the last of it."""
        with self._lock:
            if not self._ending:
                self._lock.wait(FLUSH_S)
            ending = self._ending
        self._make_room()
        while (message := self._next()) is not None:
            self._add(file, message)
        self._note(file)
        file.flush()
        os.fsync(draft.stream)
        self._directory.wrote(file.at - self.bytes)
        self.bytes, self.index_bytes = file.at, file.summary.index_bytes
        self._written_s = time.monotonic()
        self.free_bytes = self._directory.free_bytes()
        return ending

    def _next(self) -> Message | None:
        if self._first:
            return self._first.popleft()
        with self._lock:
            if not self._waiting:
                return None
            message = self._waiting.popleft()
            self._waiting_bytes -= message.size
            return message

    def _add(self, file: McapFile, message: Message) -> None:
        origin = message.origin
        channel = self._channels.get(origin)
        if channel is None:
            if len(self._channels) >= MOST_CHANNELS:
                self.missed(origin, 1)
                return
            channel = self._channels[origin] = _channel(file, origin)
        log_ns = max(self._clock.log_ns(message.at_ns), int(self.about.begins * 1e9))
        self._begins_ns = min(self._begins_ns or log_ns, log_ns)
        self._ends_ns = max(self._ends_ns, log_ns)
        file.add(channel, message.number, log_ns, message.data)
        self._counts[origin] += 1
        if origin.is_picture and self._is_nearer(message):
            self._pictures[origin.topic] = message

    def _is_nearer(self, message: Message) -> bool:
        """Return whether this picture shows the event better: the last one until then, or else the first one."""
        if message.origin.topic not in self._pictures:
            return len(self._pictures) < MOST_PICTURES
        event_ns = int(self.about.events[0].at * 1e9) if self.about.events else 0
        return self._clock.log_ns(message.at_ns) <= event_ns

    def _note(self, file: McapFile) -> None:
        """Note new lost messages, and a time of day that was set."""
        total = self.dropped.total()
        if total != self._told_dropped:
            self._told_dropped = total
            with self._lock:
                counts = {
                    f"{origin.topic} {origin.type}": str(count) for origin, count in self.dropped.items()
                }
            file.metadata(DROPPED, counts)
        wall_ns, monotonic_ns = time.time_ns(), time.monotonic_ns()
        if (jump_s := self._clock.jump_s(wall_ns, monotonic_ns)) is not None:
            at_ns = self._clock.log_ns(monotonic_ns)
            file.metadata(CLOCK, {"at_ns": str(at_ns), "time_of_day_ahead_s": f"{jump_s:.3f}"})

    def _finish(self, file: McapFile, draft: Draft) -> TakenRecording:
        pictures = (thumbnail_of(self._pictures[topic]) for topic in sorted(self._pictures))
        picture = next((one for one in pictures if one is not None), None)
        self._pictures.clear()
        if picture is not None:
            draft.path.with_suffix(".jpg").write_bytes(picture)
        begins_s = self._begins_ns / 1e9 if self._begins_ns else self.about.begins
        taken = structs.replace(
            self.about,
            begins=begins_s,
            ends=max(self._ends_ns / 1e9, begins_s),
            topics=_topics(self._counts, self.dropped),
            dropped=self.dropped.total(),
            ended_by=self.about.ended_by or (self.refusal.text if self.refusal else ""),
            thumbnail=picture is not None,
            name=draft.path.with_suffix(".mcap").name,
            controls=self._shown_controls(),
        )
        file.metadata(ABOUT, {"taken": wire.encode(taken).decode()})
        file.finish()
        self._directory.publish(draft)
        return structs.replace(taken, bytes=file.at)

    def _shown_controls(self) -> list[ShownControl]:
        with self._lock:
            changes = [(self._clock.log_ns(at_ns) / 1e9, session) for at_ns, session in self._controls]
        ends = [*(begins for begins, _ in changes[1:]), max(self._ends_ns / 1e9, self.about.ends)]
        return [
            ShownControl(session, begins, end)
            for (begins, session), end in zip(changes, ends, strict=False)
            if session
        ]


def _channel(file: McapFile, origin: Origin) -> int:
    schema = file.schema(origin.type, SCHEMAS[origin.encoding], origin.definition.encode())
    about = {"md5sum": origin.md5, "callerid": origin.publisher, "latching": "1" if origin.latched else "0"}
    about["topic"] = origin.topic
    return file.channel(origin.topic, origin.encoding, schema, about if origin.encoding != "json" else {})


def _topics(counts: Counter[Origin], dropped: Counter[Origin]) -> list[RecordedTopic]:
    totals: dict[tuple[str, str], tuple[int, int]] = {}
    for origin in counts.keys() | dropped.keys():
        messages, missing = totals.get(key := (origin.topic, origin.type), (0, 0))
        totals[key] = messages + counts[origin], missing + dropped[origin]
    return [RecordedTopic(topic, type_, *numbers) for (topic, type_), numbers in sorted(totals.items())]
