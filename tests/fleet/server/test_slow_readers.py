"""An answer is forwarded as fast as its client reads, and ends when the client disconnects."""

import json
import subprocess
import sys

from tests.processes import REPOSITORY


def result_of(program):
    command = [sys.executable, "-m", f"tests.fleet.server.{program}"]
    return json.loads(
        subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, timeout=120).stdout
    )


def test_an_endless_answer_ends_with_its_reader():
    result = result_of("endless")
    assert result["closed"]
    assert result["taken"] == 0
    assert result["sent"] < 20_000_000  # fits into the kernel's buffers


def test_a_stream_waits_for_its_reader_and_then_ends():
    result = result_of("unread")
    assert result["ended"]
    assert result["open"] == 0
    assert result["sent"] < 20_000_000
