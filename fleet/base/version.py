"""Which release of the console this is: the version of `pyproject.toml`, and the commit where somebody knows it."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

log = logging.getLogger(__name__)


@cache
def version() -> str:
    """Return the version as people read it, such as 1.0.0-rc1 (Python writes 1.0.0rc1)."""
    written: str = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    return re.sub(r"(?<=\d)(a|b|rc)(?=\d)", r"-\1", written)


@cache
def commit() -> str:
    """Return the commit by its first ten digits; an image has it in FLEET_COMMIT. Blank: nobody knows it."""
    if named := os.environ.get("FLEET_COMMIT", "").strip():
        return named[:10]
    if not (ROOT / ".git").exists():
        return ""
    # The checkout may belong to another account than the service's.
    command = ["git", "-c", "safe.directory=*", "rev-parse", "--short=10", "HEAD"]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=5, check=False)  # noqa: S603
    except (OSError, subprocess.TimeoutExpired):  # no git here
        return ""
    return done.stdout.strip()


def release() -> str:
    """Return version and commit in one line."""
    return f"{version()} ({commit()})" if commit() else version()


def log_start(process: str) -> None:
    """Write the release into the log, at the start of a process."""
    log.info("Fleet console %s: %s starts.", release(), process)
