"""``python -m tests.ros.bridge_process CONFIG RECORDS``: a bridge without Django, its records in a file."""

from __future__ import annotations

import sys
from pathlib import Path
from uuid import UUID

import msgspec

from robots.bridge.process import run
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.records.record_sink import (
    DriveSummary,
    FileChange,
    FileCut,
    GateStart,
    GateSummary,
    Holder,
    Parameters,
    Position,
    TakenDescription,
    TakenMap,
    TakenRecording,
)


class FileSink:
    """Writes one line for each record."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", buffering=1)
        self._descriptions = path.with_suffix(".description")  # its order among the records varies
        self._count = 0

    def _record(self, kind: str) -> int:
        self._count += 1
        self._file.write(f"{kind}\n")
        return self._count

    def settle(self) -> None: ...

    def test_writable(self) -> None: ...

    def ill_parts(self) -> dict[str, wire.HealthLevel]:
        return {}

    def stopped(self, holder: Holder | None, number: int, was_standing: bool) -> None: ...

    def begin_drive(self, holder: Holder, start: Position) -> int:
        return self._record("drive.start")

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        self._record("drive.end")

    def request(self, holder: Holder, kind: str, parameters: Parameters) -> int:
        return self._record(" ".join([kind, *map(str, parameters.values())]))

    def outcome(self, request: int, holder: Holder, kind: str, outcome: str, parameters: Parameters) -> None:
        self._record(f"{kind} {outcome}")

    def begin_gate(self, drive: int, holder: Holder, start: GateStart) -> int:
        return self._record(f"gate.begin {start.verdict.code}")

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        self._record("gate.end")

    def keep_map(self, taken: TakenMap) -> None:
        self._record(f"map {taken.width} x {taken.height}")

    def keep_description(self, taken: TakenDescription) -> None:
        self._descriptions.write_text(taken.problem or "read")

    def keep_recording(self, taken: TakenRecording) -> None:
        self._record(f"recording {taken.kind} {msgspec.json.encode(taken).decode()}")

    def drop_recording(self, recording: UUID) -> None:
        self._record(f"recording dropped {recording}")

    def recording_changes(self, after: UUID | None) -> list[tuple[str, FileChange]]:
        return []

    def recording_cuts(self, after: UUID | None) -> list[FileCut]:
        return []


if __name__ == "__main__":
    config = msgspec.json.decode(Path(sys.argv[1]).read_bytes(), type=BridgeConfig)
    sys.exit(run(config, FileSink(Path(sys.argv[2]))))
