"""Unchanged roslibpy and roslibjs use the simulated robot behind the gate: each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from script.stack.places import REPOSITORY
from script.stack.stack import Stack
from tests.script.programs.test_programs import ROBOT
from tests.script.support import token

HERE = Path(__file__).parent
NODE = Path(sys.executable).with_name("node")
CLIENTS = {
    "roslibpy": (sys.executable, HERE / "roslibpy_drives.py"),
    "roslib": (NODE, HERE / "roslib_drives.mjs"),
}
LONGEST_S = 150.0


@pytest.mark.parametrize("client", CLIENTS)
def test_an_unchanged_client_drives_the_robot(stack: Stack, client: str) -> None:
    tokens = [
        token(stack, role, "read", "drive", "speak", "motions", "topics", name=client)
        for role in ("operator", "staff", "observer")
    ]
    address = f"{stack.url.replace('http', 'ws', 1)}/rosbridge/{ROBOT}"
    done = subprocess.run(
        [*CLIENTS[client], address, *tokens],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr[-3000:]}"
