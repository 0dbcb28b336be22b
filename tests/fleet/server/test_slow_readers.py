"""An answer is forwarded as fast as its client reads, and ends when the client disconnects."""

import json
import subprocess
import sys

from tests.processes import REPOSITORY


def test_an_endless_answer_ends_with_its_reader():
    command = [sys.executable, "-m", "tests.fleet.server.endless"]
    told = json.loads(
        subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, timeout=120).stdout
    )
    assert told["closed"]
    assert told["taken"] == 0
    assert told["sent"] < 20_000_000  # fits into the kernel's buffers
