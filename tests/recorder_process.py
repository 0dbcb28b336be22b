"""A recorder process as the bridge runs it, and its files as the library's reader reads them."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import msgspec
from mcap.reader import SeekingReader, make_reader
from msgspec.structs import replace

from robots.bridge.recorder.recorder_messages import (
    COMMAND,
    Begin,
    Begun,
    Command,
    End,
    Finished,
    InControl,
    Progress,
    RecorderReport,
    Said,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig, RecordingPlace
from robots.shared.configuration.robot_ros import side_command
from robots.shared.records.record_sink import TakenRecording
from tests.forked import ForkedProgram, forks_of
from tests.processes import PATIENCE_S, until


class RecorderProcess:
    """One recorder."""

    def __init__(self, config: BridgeConfig, environment: dict[str, str], folder: Path) -> None:
        self.directory = folder / "recordings"
        self.config = replace(config, recordings=RecordingPlace(str(self.directory), 10**9, 0, "1.0"))
        self.reports: list[Any] = []
        program = side_command(config.ros, "recorder")[-1]
        self.process = ForkedProgram(program, environment=environment, forks=forks_of(config.ros), talks=True)
        self._write(msgspec.json.encode(self.config))
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def say(self, message: msgspec.Struct) -> None:
        """Send a request."""
        self._write(wire.encode(message))

    def begins(self, topics: wire.RecordedTopics, seconds: float = 600.0, **more: Any) -> UUID:
        """Begin a recording, and wait until its file is there."""
        order = wire.LinkRecord(uuid4(), seconds, topics, "Ada", "person-1", **more)
        self.say(Begin(order))
        begun = self.waits(Begun, lambda begun: begun.recording == order.recording)
        assert begun.refusal is None
        return order.recording

    def finishes(self, recording: UUID) -> TakenRecording:
        """End a recording, and wait until it is finished."""
        self.say(End(recording))
        return self.finished(recording)

    def finished(self, recording: UUID) -> TakenRecording:
        return self.waits(Finished, lambda one: one.taken.recording == recording).taken

    def waits(self, kind: type[Any], fits: Any = lambda report: True) -> Any:
        """Return the newest report of this kind that fits."""

        def found() -> Any:
            return next((one for one in reversed(self.reports) if isinstance(one, kind) and fits(one)), None)

        return until(found, f"{kind.__name__}: {self.reports[-3:]}", PATIENCE_S)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(PATIENCE_S)
        self._close()

    def stop(self) -> None:
        self.process.stdin.close()
        assert self.process.wait(PATIENCE_S) == 0
        self._close()

    def _close(self) -> None:
        self._reader.join(PATIENCE_S)
        self.process.stdin.close()
        self.process.stdout.close()

    def _write(self, line: bytes) -> None:
        self.process.stdin.write(line + b"\n")
        self.process.stdin.flush()

    def _read(self) -> None:
        decoder = msgspec.json.Decoder(RecorderReport)
        for line in self.process.stdout:
            self.reports.append(decoder.decode(line))

    @property
    def bytes(self) -> int:
        """Bytes of the present recording."""
        recording = self.progress.recording
        return 0 if recording is None else recording.bytes

    @property
    def progress(self) -> Progress:
        return self.waits(Progress)


def said(fence: int) -> Said:
    """Return a stick position of a control session, as the bridge tells it."""
    command = Command(wire.Drive(fence, 1, 0.0, x=0.5, w=0.0))
    return Said(COMMAND, time.monotonic_ns(), msgspec.Raw(wire.encode(command)))


def ends_with_its_robot(recorder: RecorderProcess, lose: Callable[[], object]) -> None:
    """Check that the recordings of a robot that leaves are finished, and that this ends the recorder."""
    recorder.say(InControl("person-1", "session-1"))
    until(lambda: recorder.progress.black_box, "the black box")
    recording = recorder.begins("pictures_not")
    recorder.say(said(5))
    lose()
    assert recorder.finished(recording).ended_by == "The connection to the robot’s ROS was lost."
    box = recorder.waits(Finished, lambda one: one.taken.kind == "black_box").taken
    assert [event.event for event in box.events] == ["fault"]
    for taken in (box, recorder.finished(recording)):
        assert COMMAND in messages_of(recorder.directory / taken.name)
    assert recorder.process.wait(PATIENCE_S) == 1
    recorder.kill()


def messages_of(path: Path) -> dict[str, list[tuple[str, bytes]]]:
    """Return type and bytes of each message, by topic. The file must open with its summary."""
    found: dict[str, list[tuple[str, bytes]]] = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert isinstance(reader, SeekingReader)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        for schema, channel, message in reader.iter_messages():
            found[channel.topic].append((schema.name if schema else "", message.data))
        assert summary.statistics.message_count == sum(map(len, found.values()))
    return found
