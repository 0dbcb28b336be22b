"""An answer is forwarded as fast as its client reads, and ends when the client disconnects."""

import json
import subprocess
import sys

from tests.processes import REPOSITORY


def told_by(program):
    command = [sys.executable, "-m", f"tests.fleet.server.{program}"]
    return json.loads(
        subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, timeout=120).stdout
    )


def test_an_endless_answer_ends_with_its_reader():
    told = told_by("endless")
    assert told["closed"]
    assert told["taken"] == 0
    assert told["sent"] < 20_000_000  # fits into the kernel's buffers


def test_a_stream_waits_for_its_reader_and_then_ends():
    told = told_by("unread")
    assert told["ended"]
    assert told["open"] == 0
    assert told["sent"] < 20_000_000
