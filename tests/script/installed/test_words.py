"""script/install-service with systemd and stand-ins for what it installs: words, settings and roles of its units."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator

import pytest

from script.stack.places import REPOSITORY
from tests.script.installed.machine import Machine, empty_machine, missing

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())

SAYS = 'echo "Serving on $*"\nseq 2000\necho "One-time code: AB"\n'
READY = f"#!/bin/bash\n{SAYS}systemd-notify --ready\nexec sleep 1000\n"
STAND_INS = {
    "opt/fleet/script/setup": "#!/bin/bash\n",
    "opt/fleet/script/serve": READY,
    "opt/fleet/.venv/bin/python": "#!/bin/bash\n",
    "usr/bin/python3": "#!/bin/bash\necho a-secret\n",  # an empty Debian has none
}


@pytest.fixture
def machine() -> Iterator[Machine]:
    with empty_machine() as machine:
        for name, program in STAND_INS.items():
            path = machine.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(program)
        machine.run("chmod", "-R", "a+rX", "/opt/fleet")
        machine.run("chmod", "755", *(f"/{name}" for name in STAND_INS))
        script = machine.root / "opt/fleet/script/install-service"
        for name in ("script/install-service", "script/install-backup", "script/service/units.sh"):
            (machine.root / "opt/fleet" / name).parent.mkdir(exist_ok=True)
            shutil.copy(REPOSITORY / name, machine.root / "opt/fleet" / name)
        # Only our own program is the service's main process and may say that it is ready.
        script.write_text(script.read_text().replace("Type=notify\n", "Type=notify\nNotifyAccess=all\n"))
        yield machine


def starts(machine: Machine, unit: str) -> tuple[str, str]:
    """Return the words and the settings with which a unit starts."""
    text = (machine.root / f"etc/systemd/system/{unit}.service").read_text()
    [words] = re.findall(r"^ExecStart=/opt/fleet/script/serve (.*)$", text, re.MULTILINE)
    [settings] = re.findall(r"^EnvironmentFile=(.*)$", text, re.MULTILINE)
    return words, settings


def test_it_keeps_its_words_until_it_gets_others(machine: Machine) -> None:
    said = machine.shell("script/install-service --env /etc/lab.env -- --port 443")
    assert "Made the system user fleet." in said and "Serving on console --port 443\n" in said
    assert "One-time code: AB\n" in said  # the last line before it is ready
    assert machine.run("stat", "-c", "%a %U", "/etc/lab.env", "/var/lib/fleet") == "600 root\n700 fleet\n"
    machine.shell("script/install-service")
    assert starts(machine, "fleet") == ("console --port 443", "/etc/lab.env")
    machine.shell("script/install-service -- --port 8001")
    assert starts(machine, "fleet") == ("console --port 8001", "/etc/lab.env")


def test_the_nightly_backup_follows_the_service_to_another_user(machine: Machine) -> None:
    machine.shell("script/install-service")
    machine.shell("script/install-backup '/var/backups/50% of my lab' --at 04:00 -- --keep 7")
    refused = machine.shell("script/install-service --user lab", check=False)
    assert "lab cannot write to /var/backups/50% of my lab: sudo chown -R lab" in refused
    machine.shell("chown -R lab '/var/backups/50% of my lab' && script/install-service")
    service = (machine.root / "etc/systemd/system/fleet-backup.service").read_text()
    assert "\nUser=lab\n" in service
    assert """ manage.py backup "/var/backups/50%% of my lab" --keep 7\n""" in service
    assert "OnCalendar=04:00" in (machine.root / "etc/systemd/system/fleet-backup.timer").read_text()


def test_other_roles_want_settings_of_the_console_and_run_beside_it(machine: Machine) -> None:
    machine.shell("script/install-service")
    machine.shell("mv /etc/fleet.env /etc/copy.env")
    refused = machine.shell("script/install-service web; script/install-service bridges", check=False)
    assert "there is no /etc/fleet.env: copy it from the computer of the console." in refused
    assert "there is no /etc/fleet.env: the console makes it, see Add a bridge host" in refused
    machine.shell("install -m 644 /etc/copy.env /etc/fleet.env")
    assert machine.run("stat", "-c", "%a", "/etc/fleet.env") == "644\n"  # as it comes from another computer
    for role in ("web", "bridges"):
        assert f"fleet-{role} runs, and starts again after a reboot." in machine.shell(
            f"script/install-service {role}"
        )
        assert machine.run("stat", "-c", "%a", "/etc/fleet.env") == "640\n"
    assert (
        machine.run("systemctl", "is-active", "fleet", "fleet-web", "fleet-bridges").split() == ["active"] * 3
    )
