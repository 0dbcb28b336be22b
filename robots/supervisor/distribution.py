"""The environment variables of an installed distribution of ROS 2, as its set-up script sets them.

The script is a program of this computer, and bash runs it: only if nobody but root and the console's own account can
change it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

from robots.shared.ros2.environment import VERSION
from robots.shared.sentences import say
from robots.supervisor.unready import Unready

PATIENCE_S = 5.0
AGAIN_S = 60.0  # a script that failed is tried again after this time
_OWN = {"_", "PWD", "OLDPWD", "SHLVL"}  # of the shell
_PYTHON = re.compile(r"python3\.\d+")


class _Answer(NamedTuple):
    """The variables that a script gave last."""

    mtime_ns: int
    at_s: float
    given: dict[str, str] | Unready


_answers: dict[str, _Answer] = {}


def variables(script: str) -> dict[str, str]:
    """Return the variables that a set-up script changes. Raises `Unready`. It runs once, and again when it changes."""
    try:
        mtime_ns = Path(script).stat().st_mtime_ns
    except OSError as error:
        words = "The set-up script {script} of ROS cannot be read ({error})."
        raise Unready(say(words, script=script, error=error.strerror)) from error
    last, now_s = _answers.get(script), time.monotonic()
    if last is None or last.mtime_ns != mtime_ns or (_failed(last) and now_s - last.at_s > AGAIN_S):
        last = _answers[script] = _Answer(mtime_ns, now_s, _given(script))
    if isinstance(last.given, Unready):
        raise last.given
    return last.given


def _failed(answer: _Answer) -> bool:
    return isinstance(answer.given, Unready)


def _given(script: str) -> dict[str, str] | Unready:
    status = Path(script).stat()
    if status.st_uid not in {0, os.getuid()} or status.st_mode & 0o022:
        words = "The set-up script {script} of ROS is not run, because other people of that computer can change it."
        return Unready(say(words, script=script))
    command = [shutil.which("bash") or "bash", "-c", '. "$0" >&2 && env -0', script]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PATIENCE_S, check=True)  # noqa: S603
    except (OSError, subprocess.SubprocessError) as error:
        return Unready(
            say("The set-up script {script} of ROS failed ({error}).", script=script, error=str(error))
        )
    pairs = (line.partition("=") for line in done.stdout.decode(errors="replace").split("\0") if line)
    found = {name: value for name, _, value in pairs}
    changed = {name: value for name, value in found.items() if os.environ.get(name) != value}
    return _fault(script, found) or {name: value for name, value in changed.items() if name not in _OWN}


def _fault(script: str, found: dict[str, str]) -> Unready | None:
    """Return why the console cannot use this distribution: it has no rclpy, or one for another Python."""
    folders = [Path(path) for path in found.get("PYTHONPATH", "").split(os.pathsep) if path]
    made_for = {
        name for folder in folders if (folder / "rclpy").is_dir() for name in _PYTHON.findall(str(folder))
    }
    if VERSION in made_for:
        return None
    if not made_for:
        return Unready(say("The set-up script {script} of ROS offers no rclpy.", script=script))
    words = (
        "The ROS of {script} is made for {theirs}, the console runs with {ours}: leave the set-up script empty, "
        "so that the console uses its own packages."
    )
    return Unready(say(words, script=script, theirs=", ".join(sorted(made_for)), ours=VERSION))
