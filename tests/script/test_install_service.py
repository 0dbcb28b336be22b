"""The systemd unit that script/install-service writes."""

from __future__ import annotations

import getpass
import shutil
import subprocess
from pathlib import Path

import pytest

from script.stack.places import REPOSITORY


def unit(*words: str) -> subprocess.CompletedProcess[str]:
    command = ["script/install-service", "--print", *words]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)


def test_the_unit_starts_this_console_with_the_given_words() -> None:
    lines = unit("--user", "lab", "--env", "/etc/lab.env", "--", "--port", "8001").stdout.splitlines()
    assert {"User=lab", "EnvironmentFile=/etc/lab.env", f"WorkingDirectory={REPOSITORY}"} <= set(lines)
    assert f"ExecStart={REPOSITORY}/script/serve --port 8001" in lines


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    file = tmp_path / "fleet.service"
    file.write_text(unit("--user", getpass.getuser()).stdout)
    verified = subprocess.run(
        ["systemd-analyze", "verify", file], capture_output=True, text=True, check=False
    )
    assert (verified.returncode, verified.stderr) == (0, "")


def test_an_unknown_word_is_refused() -> None:
    refused = unit("--prot", "8001")
    assert refused.returncode == 2
    assert "--prot" in refused.stderr
