"""script/manage and script/install-backup: user, settings and limits of the console's service."""

from __future__ import annotations

import getpass
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from script.service import manage
from script.stack.places import REPOSITORY

UNIT = """\
[Unit]
Description=Fleet console

[Service]
Type=notify
User={user}
WorkingDirectory=/opt/fleet
# a comment
EnvironmentFile={env}
Environment=FLEET_VAR=/var/lib/fleet
ExecStart=/opt/fleet/script/serve console
Restart=on-failure
RestartSec=5
TimeoutStartSec=900
LimitRTPRIO=10
NoNewPrivileges=yes
ProtectSystem=full

[Install]
WantedBy=multi-user.target
"""


@pytest.fixture
def units(tmp_path: Path) -> Path:
    env = tmp_path / "fleet.env"
    env.write_text("# settings\nFLEET_SECRET_KEY=a $key # here\nFLEET_HOSTS='it'\"'\"'s here'\n\n")
    (tmp_path / "fleet.service").write_text(UNIT.format(user=getpass.getuser(), env=env))
    return tmp_path


def test_a_command_runs_with_the_settings_of_the_service(
    units: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run: list[tuple[list[str], dict[str, str]]] = []
    monkeypatch.setenv("FLEET_DATABASE_URL", "of the shell")
    monkeypatch.setattr(os, "execve", lambda _program, words, environment: run.append((words, environment)))
    for name in ("initgroups", "setgid", "setuid", "chdir"):
        monkeypatch.setattr(os, name, lambda *_: None)
    manage.main(["backup", "/var/backups/fleet"], units)
    ((words, environment),) = run
    assert words[1:] == ["manage.py", "backup", "/var/backups/fleet"]
    own = {name: value for name, value in environment.items() if name.startswith("FLEET_")}
    assert own == {
        "FLEET_VAR": "/var/lib/fleet",
        "FLEET_SECRET_KEY": "a $key # here",
        "FLEET_HOSTS": "it's here",
    }


def test_without_a_service_the_command_says_what_to_do(tmp_path: Path) -> None:
    assert "manage.py" in manage.main(["backup"], tmp_path)


def test_settings_that_cannot_be_read_are_named(units: Path) -> None:
    (units / "fleet.env").unlink()
    assert "fleet.env'. Run it with sudo." in manage.main(["backup"], units)


def test_the_nightly_backup_runs_like_the_service(units: Path) -> None:
    command = ["script/install-backup", "--print", "--service", units / "fleet.service", "/var/backups/fleet"]
    service, timer = subprocess.run(
        command, cwd=REPOSITORY, capture_output=True, text=True, check=True
    ).stdout.split("\n\n# /etc")
    lines = service.splitlines()
    python = REPOSITORY / ".venv/bin/python"
    assert f"ExecStart={python} manage.py backup /var/backups/fleet --keep 14 --verify" in lines
    assert {"Type=oneshot", f"User={getpass.getuser()}", "NoNewPrivileges=yes", "ProtectSystem=full"} <= set(
        lines
    )
    assert not [line for line in lines if line.startswith(("Restart", "Limit", "Timeout", "Type=notify"))]
    assert "OnCalendar=03:15" in timer
    if shutil.which("systemd-analyze"):
        for name, text in (("fleet-backup.service", service), ("fleet-backup.timer", f"# /etc{timer}")):
            (units / name).write_text(text)
        units_ = [units / "fleet-backup.service", units / "fleet-backup.timer"]
        verified = subprocess.run(["systemd-analyze", "verify", *units_], capture_output=True, text=True)
        assert (verified.returncode, verified.stderr) == (0, "")
