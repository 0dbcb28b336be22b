"""An answer is forwarded as fast as its client reads, and ends when the client disconnects, or reads nothing."""

import json
import subprocess
import sys

import pytest

from tests.processes import REPOSITORY


def result_of(way):
    command = [sys.executable, "-m", "tests.fleet.server.pages.endless", way]
    printed = subprocess.run(command, cwd=REPOSITORY, stdout=subprocess.PIPE, check=True, timeout=120).stdout
    return json.loads(printed)


def test_an_answer_that_is_read_goes_on():
    assert result_of("reads")["closed"]  # the client closes it at the end


@pytest.mark.parametrize("way", ["leaves", "stays"])
def test_an_endless_answer_ends_with_its_reader(way):
    result = result_of(way)
    assert result["closed"]
    assert result["taken"] == 0
    assert result["sent"] < 20_000_000  # fits into the kernel's buffers
