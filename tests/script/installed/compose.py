"""deploy/compose.yaml, run by podman-compose in a network of its own, so that its fixed ports are free."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.script.installed.images import DEPLOY
from tests.script.installed.machine import INSTALLED_S

PROGRAM = "podman-compose==1.5.0"  # Debian 12 has 1.0.3, which cannot use the computer's network: docs/containers.md
NETWORK = 0x40000000  # CLONE_NEWNET
# A computer of tests may not raise limits of resources (no CAP_SYS_RESOURCE).
RUNTIME = """#!/usr/bin/python3
import json, os, sys
words = sys.argv[1:]
file = ""
if "create" in words:
    file = words[words.index("--bundle") + 1] + "/config.json"
elif "exec" in words:
    file = words[words.index("--process") + 1]
if file:
    with open(file) as known:
        config = json.load(known)
    config.get("process", config)["rlimits"] = []
    with open(file, "w") as changed:
        json.dump(config, changed)
os.execvp("runc", ["runc", *words])
"""


@contextmanager
def network_apart() -> Iterator[None]:
    """Give this thread, and what it starts, a new network with nothing but itself."""
    libc = ctypes.CDLL(None, use_errno=True)
    own = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
    assert libc.unshare(NETWORK) == 0, os.strerror(ctypes.get_errno())
    try:
        subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
        yield
    finally:
        assert libc.setns(own, NETWORK) == 0
        os.close(own)


class Compose:
    """The containers of compose.yaml. Its folder has the copy of deploy/ that an administrator changes."""

    def __init__(self, place: Path) -> None:
        self.folder = place / "deploy"
        shutil.copytree(DEPLOY, self.folder)
        self._program = place / "podman-compose" / "bin" / "podman-compose"
        subprocess.run([sys.executable, "-m", "venv", self._program.parents[1]], check=True)
        subprocess.run([self._program.with_name("pip"), "install", "--quiet", PROGRAM], check=True)
        runtime = place / "runtime"
        runtime.write_text(RUNTIME)
        runtime.chmod(0o755)
        settings = place / "containers.conf"
        settings.write_text(
            f'[engine]\ncgroup_manager = "cgroupfs"\nevents_logger = "file"\ntmp_dir = "{place}/state"\n'
            f'runtime = "runc"\n[engine.runtimes]\nrunc = ["{runtime}"]\n'
            f'[network]\nnetwork_config_dir = "{place}/networks"\n'
        )
        self._environment = os.environ | {"CONTAINERS_CONF": str(settings)}

    def __call__(self, *words: str) -> str:
        """Run podman-compose."""
        return self._run(self._program, *words)

    def podman(self, *words: str) -> str:
        return self._run("podman", *words)

    def pid(self, service: str) -> int:
        """Return the process id of a service's first process here; 0 if it does not run."""
        return int(self.podman("inspect", "--format", "{{.State.Pid}}", f"fleet_{service}_1"))

    def log(self, service: str) -> str:
        return self.podman("logs", f"fleet_{service}_1")

    def _run(self, *command: Any) -> str:
        done = subprocess.run(
            command,
            cwd=self.folder,
            env=self._environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=INSTALLED_S,
        )
        assert done.returncode == 0, f"{command}:\n{done.stdout[-5000:]}"
        return done.stdout


@contextmanager
def composed(place: Path) -> Iterator[Compose]:
    """Nothing is left of its containers afterwards."""
    compose = Compose(place)
    try:
        yield compose
    finally:
        compose("down", "--volumes")
