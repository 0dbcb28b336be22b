"""script/manage: a command of manage.py as the service of this computer runs it: as its user, with its settings."""

from __future__ import annotations

import os
import pwd
import shlex
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from script.stack.places import REPOSITORY

UNITS = Path("/etc/systemd/system")
NAMES = ("fleet.service", "fleet-web.service", "fleet-bridges.service")


def main(words: Sequence[str], units: Path = UNITS) -> str:
    """Become the service's user and the command. Return what prevents it."""
    unit = next((units / name for name in NAMES if (units / name).exists()), None)
    if unit is None:
        return f"There is no {NAMES[0]} in {units}: run .venv/bin/python manage.py with the settings as variables."
    service = read(unit.read_text())
    account = pwd.getpwnam(service["User"])
    if os.geteuid() not in (0, account.pw_uid):
        return f"Run it with sudo: the service belongs to {account.pw_name}."
    try:
        own = dict(variables(Path(service["EnvironmentFile"]).read_text()))
    except KeyError:
        own = {}
    except OSError as error:  # a file of root's
        return f"The settings cannot be read: {error}. Run it with sudo."
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": account.pw_dir,
        **dict(variables(service.get("Environment", ""))),
        **own,
    }
    environment |= {name: os.environ[name] for name in ("TERM", "LANG") if name in os.environ}
    if os.geteuid() == 0:
        os.initgroups(account.pw_name, account.pw_gid)
        os.setgid(account.pw_gid)
        os.setuid(account.pw_uid)
    os.chdir(REPOSITORY)
    python = str(REPOSITORY / ".venv/bin/python")
    os.execve(python, [python, "manage.py", *words], environment)  # noqa: S606 - no shell


def read(unit: str) -> dict[str, str]:
    """Return the names and values of a unit's lines; of a name with several, the last. The unit has % twice."""
    return dict(
        line.replace("%%", "%").split("=", 1)
        for line in unit.splitlines()
        if "=" in line and not line.startswith("#")
    )


def variables(lines: str) -> Iterator[tuple[str, str]]:
    """Yield the variables of a file as systemd reads it: NAME=value, in quotes or not."""
    for line in lines.splitlines():
        name, equals, value = line.strip().partition("=")
        if equals and not name.startswith(("#", ";")):
            yield name, "".join(shlex.split(value)) if value[:1] in ("'", '"') else value


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
