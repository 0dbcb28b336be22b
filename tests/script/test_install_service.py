"""The systemd units that script/install-service writes."""

from __future__ import annotations

import getpass
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from script.stack.places import REPOSITORY

ROLES = ["console", "web", "bridges"]
MOST_EXPOSED = 3.0  # of `systemd-analyze security`
with_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")


def printed(*words: str) -> subprocess.CompletedProcess[str]:
    command = ["script/install-service", *words]
    return subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)


def units(*words: str) -> dict[str, str]:
    """Return the printed units by their names."""
    parts = re.split(r"^# \S+/(\S+)\n", printed(*words).stdout, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_unit_starts_this_console_with_the_given_words() -> None:
    unit = units("--print", "--user", "lab", "--env", "/etc/lab.env", "--", "--port", "8001")["fleet.service"]
    lines = unit.splitlines()
    assert {"User=lab", "EnvironmentFile=/etc/lab.env", f"WorkingDirectory={REPOSITORY}"} <= set(lines)
    assert f"ExecStart={REPOSITORY}/script/serve console --port 8001" in lines
    assert "FLEET_VAR=/var/lib/fleet" in unit  # another user than the owner of the checkout


def test_the_owner_keeps_the_data_in_the_checkout() -> None:
    unit = units("--print", "--user", REPOSITORY.owner())["fleet.service"]
    assert ("FLEET_VAR" in unit) == (REPOSITORY.owner() == "root")


@pytest.mark.parametrize(("role", "name"), [("web", "fleet-web"), ("bridges", "fleet-bridges")])
def test_each_role_has_a_unit(role: str, name: str) -> None:
    assert f"script/serve {role}\n" in units(role, "--print")[f"{name}.service"]


@pytest.mark.parametrize("before", ["serve", "serve console"])  # releases before 1.0.0-rc1 had no roles
def test_words_of_before_stay(before: str, tmp_path: Path) -> None:
    (tmp_path / "fleet.service").write_text(
        f"[Service]\nUser=lab\nExecStart=/opt/fleet/script/{before} --bind 10.0.0.2 --port 8001\n"
    )
    unit = again(tmp_path)
    assert f"ExecStart={tmp_path}/script/serve console --bind 10.0.0.2 --port 8001\n" in unit
    assert "User=lab\n" in unit


def test_words_with_spaces_and_signs_reach_the_console(tmp_path: Path) -> None:
    words = ["--certificate", "/etc/my lab/50%.crt", "--authority", "it's $5"]
    unit = units("--print", "--env", "/etc/50%.env", "--", *words)["fleet.service"]
    assert """ console --certificate "/etc/my lab/50%%.crt" --authority "it's $$5"\n""" in unit
    assert "\nEnvironmentFile=/etc/50%%.env\n" in unit
    (tmp_path / "fleet.service").write_text(unit)
    assert again(tmp_path) == unit.replace(str(REPOSITORY), str(tmp_path))
    assert 'no word with " or' in printed("--print", "--", 'a"b').stderr


def again(folder: Path) -> str:
    """Return what install-service prints for the unit that is in this folder."""
    script = (REPOSITORY / "script/install-service").read_text()
    script = script.replace("units=/etc/systemd/system", f"units={folder}").replace(
        "[[ -n $print || ! -r", "[[ ! -r"
    )
    (folder / "script/service").mkdir(parents=True)
    (folder / "script/install-service").write_text(script)
    shutil.copy(REPOSITORY / "script/service/units.sh", folder / "script/service")
    command = ["bash", str(folder / "script/install-service"), "--print"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return re.split(r"^# \S+\n", done.stdout, flags=re.MULTILINE)[1]


def test_only_a_port_below_1024_needs_a_right() -> None:
    right = "AmbientCapabilities=CAP_NET_BIND_SERVICE"
    assert right in units("--print", "--", "--port", "443", "--bind", "0.0.0.0")["fleet.service"]  # noqa: S104
    assert right in units("--print", "--", "--port=443")["fleet.service"]
    assert right not in units("--print", "--", "--port", "8443")["fleet.service"]


@with_systemd
@pytest.mark.parametrize("role", ROLES)
def test_systemd_accepts_the_units_and_finds_them_hard(role: str, tmp_path: Path) -> None:
    found = units(role, "--print", "--user", getpass.getuser(), "--", "--port", "443")
    for name, unit in found.items():
        (tmp_path / name).write_text(unit)
    for name in found:
        judged = analyzed("security", "--offline=true", "--no-pager", str(tmp_path / name))
        [exposure] = re.findall(r"Overall exposure level for \S+: ([0-9.]+)", judged.stdout)
        assert float(exposure) <= MOST_EXPOSED
    main = next(iter(found))
    verified = analyzed("verify", str(tmp_path / main))
    assert (verified.returncode, verified.stderr) == (0, "")
    assert "RestrictRealtime" not in found[main]  # commands travel with real-time priority


def analyzed(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["systemd-analyze", *words], capture_output=True, text=True, check=False)


def test_an_unknown_word_is_refused() -> None:
    refused = printed("--print", "--prot", "8001")
    assert refused.returncode == 2
    assert "--prot" in refused.stderr
