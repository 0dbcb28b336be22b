"""``python -m tests.ros.bridge_process CONFIG RECORDS``: a bridge without Django, its records in a file."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec

from robots.bridge.config import BridgeConfig
from robots.bridge.gate.values import Verdict
from robots.bridge.process import run
from robots.bridge.sink import DriveSummary, GateSummary, Holder, MotionEnd


class FileSink:
    """One line per record, in order."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", buffering=1)
        self._count = 0

    def _record(self, kind: str) -> int:
        self._count += 1
        self._file.write(f"{kind}\n")
        return self._count

    def begin_drive(self, holder: Holder) -> int:
        return self._record("drive.start")

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        self._record("drive.end")

    def look_ahead(self, holder: Holder) -> int:
        return self._record("head.look_ahead")

    def begin_motion(self, holder: Holder, motion: str) -> int:
        return self._record(f"motion.start {motion}")

    def end_motion(self, motion: int, holder: Holder, end: MotionEnd) -> None:
        self._record(f"motion.end {end.outcome}")

    def begin_gate(self, drive: int, holder: Holder, verdict: Verdict) -> int:
        return self._record(f"gate.begin {verdict.code}")

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        self._record("gate.end")


if __name__ == "__main__":
    config = msgspec.json.decode(Path(sys.argv[1]).read_bytes(), type=BridgeConfig)
    sys.exit(run(config, FileSink(Path(sys.argv[2]))))
