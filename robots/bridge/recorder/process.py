"""The recorder's process: reads the bridge's config from the first line of stdin, then requests.

Each message is one JSON line (`robots.bridge.recorder.recorder_messages`). This process ends when stdin ends or the
robot is gone: it finishes its files then. The bridge starts another one when it needs it.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable

import msgspec
from msgspec import Struct

from robots.bridge.recorder.reading import Reading, RecorderSide
from robots.bridge.recorder.recorder import Recorder
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.memory import limit_memory
from robots.shared.processes.shutdown import exit_within
from robots.shared.processes.vital import start_vital

NICE = 5  # commands to the robot go first
MOST_BYTES = 512 * 1024 * 1024  # of memory
FINISH_S = 1.2  # to finish files, after the end of stdin
END_S = 1.5  # until the process must have ended
TICK_S = 1.0
RECOVER_S = 60.0  # between two looks for files that are cut, or have no row


class Lines:
    """Writes whole lines to stdout, from any thread; blocks while the reader does not read."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __call__(self, report: Struct) -> None:
        with self._lock:
            sys.stdout.buffer.write(wire.encode(report) + b"\n")
            sys.stdout.buffer.flush()


def _tick(recorder: Recorder) -> None:
    while True:
        recorder.tick()
        time.sleep(TICK_S)


def _recover(recorder: Recorder) -> None:
    while True:
        try:
            recorder.recover()
        except OSError as error:
            logging.getLogger("robots").warning("earlier recordings cannot be read: %s", error)
        time.sleep(RECOVER_S)


def _end_with_the_robot(recorder: Recorder) -> None:
    """Keep what was before the loss: nothing more comes."""
    exit_within(END_S)
    recorder.lost_robot()
    recorder.close(FINISH_S)


def run(join: Callable[[BridgeConfig, Callable[[], object]], RecorderSide]) -> None:
    """Run until stdin ends. `join` joins the robot, and calls its second argument when the robot is gone."""
    logging.basicConfig(format="recorder: %(message)s")
    logging.getLogger("robots").setLevel(logging.INFO)
    for number in (signal.SIGTERM, signal.SIGINT):  # the bridge handles them; its end closes our stdin
        signal.signal(number, signal.SIG_IGN)
    os.nice(NICE)
    limit_memory(MOST_BYTES)
    config = msgspec.json.decode(sys.stdin.buffer.readline(), type=BridgeConfig)
    if config.recordings is None:
        raise SystemExit("this bridge keeps no recordings")
    side = join(config, lambda: _end_with_the_robot(recorder))
    recorder = Recorder(config, config.recordings, Lines(), lambda wanted: reading.follow(wanted))
    reading = Reading(side, recorder)
    start_vital(reading.run, "reading")
    start_vital(lambda: _tick(recorder), "tick")
    threading.Thread(target=_recover, args=(recorder,), name="recover", daemon=True).start()
    for line in sys.stdin.buffer:
        recorder.handle_line(line)
    exit_within(END_S)
    recorder.close(FINISH_S)
    side.leave()
