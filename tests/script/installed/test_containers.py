"""The image of the console, built and run as docs/containers.md says; the base is made here instead of downloaded."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml

from script.stack.client import sign_in
from script.stack.places import REPOSITORY
from script.stack.processes import Child
from script.stack.serve import arguments
from script.stack.stack import Account
from tests.processes import free_port, outside, until
from tests.script.first_run import PAGE_S, set_up
from tests.script.installed.compose import Compose, composed, network_apart
from tests.script.installed.images import DEPLOY, IMAGE, build_console, build_servers, buildah, storage
from tests.script.installed.machine import INSTALLED_S, missing
from tests.script.support import Family

STAFF = Account("first", "staff", "a long walk on the beach")
STARTS_S = 120.0
ENDED_S = 30.0
USER = 900  # of the image, not root
PODMAN = ("buildah", "podman", "runc", "ip")
PAGE = (REPOSITORY / "docs" / "containers.md").read_text()
NAME, SITE = "fleet.lab.example", "https://localhost"


def test_compose_starts_roles_that_exist_behind_its_proxy() -> None:
    services: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())["services"]
    consoles = [one for one in services.values() if one["image"] == "fleet"]
    assert [arguments(one["command"]).role for one in consoles] == ["console"]
    for one in consoles:
        assert arguments(one["healthcheck"]["test"][2:]).is_ready
        assert one["cap_drop"] == ["ALL"] and one["read_only"]
    port = arguments(consoles[0]["command"]).port
    assert f"reverse_proxy 127.0.0.1:{port} " in (DEPLOY / "Caddyfile").read_text()
    database = services["database"]
    assert database["command"][-1] == "listen_addresses=127.0.0.1"  # of this computer only
    assert database["environment"]["POSTGRES_INITDB_ARGS"] == "--auth-host=scram-sha-256"
    redis = services["redis"]
    port = redis["command"].index("--port")
    assert (redis["command"][port + 1], redis["network_mode"]) == ("0", "none")
    assert {one["network_mode"] for one in services.values() if one is not redis} == {"host"}
    # podman-restart.service starts these after a boot, and no others.
    assert {one["restart"] for one in services.values()} == {"always"}


def test_the_image_has_all_files_and_runs_as_its_own_user() -> None:
    steps = (DEPLOY / "Containerfile").read_text()
    for copied in re.findall(r"^COPY (.*) \S+$", steps, re.MULTILINE):
        assert all((REPOSITORY / name).exists() for name in copied.split())
    assert re.findall(r"^USER (\S+)$", steps, re.MULTILINE) == ["fleet"]
    assert re.search(r'^ENTRYPOINT \[.*"script/serve"\]$', steps, re.MULTILINE)
    assert re.search(r'^CMD \["console"\]$', steps, re.MULTILINE)


def test_secrets_and_data_stay_out_of_the_image() -> None:
    """Docker reads only this file, podman and buildah read it, too."""
    assert {"var", "**/.env", "**/*.key", "**/*.crt"} <= set(
        (REPOSITORY / ".dockerignore").read_text().splitlines()
    )
    assert not (REPOSITORY / ".containerignore").exists()  # podman would prefer it


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """The console's built image, in a storage of its own; these are the words that trust it."""
    with storage(tmp_path_factory.mktemp("images")) as policy:
        build_console(policy)
        yield policy


@pytest.mark.timeout(INSTALLED_S)
@pytest.mark.skipif(bool(missing("buildah")), reason=missing("buildah"))
@pytest.mark.usefixtures("policy")
def test_the_image_is_built_and_runs_as_a_console(tmp_path: Path) -> None:
    port = free_port()
    container = buildah("from", "--pull-never", IMAGE)
    for setting in (f"FLEET_SECRET_KEY={'s' * 40}", "FLEET_HOSTS=localhost"):
        buildah("config", "--env", setting, container)
    log = tmp_path / "log"
    words = ["/usr/bin/tini", "-s", "--", "script/serve", "console", "--port", str(port)]
    buildah_program = shutil.which("buildah") or ""
    environment = {**outside(), "CONTAINERS_STORAGE_CONF": os.environ["CONTAINERS_STORAGE_CONF"]}
    run = [buildah_program, "run", "--isolation", "chroot", "--network", "host", container, "--", *words]
    console = Child("container", run, env=environment, log=log)
    try:
        until(lambda: "One-time code" in log.read_text() or not console.running, "the code", STARTS_S)
        page = set_up(log.read_text(), STAFF, "TIAGo 42", "http://127.0.0.1:9")  # no robot is there
        assert "Is the robot on, and in this network?" in page
        assert "(0123456789)" in log.read_text()  # the commit
        ready = ["script/serve", "--port", str(port), "--is-ready"]
        buildah("run", "--isolation", "chroot", "--network", "host", container, "--", *ready)
        serves = Family(console.pid).named(".venv/bin/python -m script.stack.serve")
        assert Path(f"/proc/{serves}").stat().st_uid == USER
        console.signal(signal.SIGTERM)
        assert console.wait(ENDED_S)
    finally:
        console.kill_group()


@pytest.mark.timeout(INSTALLED_S)
@pytest.mark.skipif(bool(missing(*PODMAN)), reason=missing(*PODMAN))
def test_compose_keeps_its_data_and_starts_again_what_dies(
    policy: tuple[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_servers(policy, tmp_path)
    with composed(tmp_path) as compose, network_apart():  # pip needs the network
        [backup] = commands(r"\[backup\]\(backup.md\)")
        caddy = compose.folder / "Caddyfile"
        caddy.write_text(caddy.read_text().replace(f"{NAME} {{", "localhost {"))
        for line in re.findall(r"^ {7}(\(umask .*|echo FLEET_HOSTS.*)$", PAGE, re.MULTILINE):
            subprocess.run(["bash", "-c", line.replace(NAME, "localhost")], cwd=compose.folder, check=True)
        compose("up", "-d")
        until(lambda: "One-time code" in compose.log("console"), "the code", STARTS_S)
        volume = compose.podman("volume", "inspect", "--format", "{{.Mountpoint}}", "fleet_caddy").strip()
        monkeypatch.setenv("SSL_CERT_FILE", f"{volume}/caddy/pki/authorities/local/root.crt")
        set_up(compose.log("console"), STAFF, "TIAGo 42", "http://127.0.0.1:9")
        assert "all are as written" in compose(*backup[:1], "-T", *backup[1:])
        anybody = ["psql", "--no-password", "postgresql://fleet@127.0.0.1/fleet", "--command", "SELECT 1"]
        asked = subprocess.run(anybody, capture_output=True, text=True)
        assert "no password supplied" in asked.stderr, asked
        compose("down")
        compose("up", "-d")
        until(is_served, "the console after down and up", STARTS_S)
        browser = Browser()
        assert "TIAGo 42" in browser.page("/robots/tiago-42/")
        web = web_process(compose)
        os.kill(web, signal.SIGKILL)
        until(lambda: web_process(compose) not in (0, web), "another web process", STARTS_S)
        until(is_served, "its answer", STARTS_S)
        for service in ("redis", "database", "console"):
            killed = compose.pid(service)
            os.kill(killed, signal.SIGKILL)
            until(lambda: compose.pid(service) not in (0, killed), f"{service} is back", ENDED_S)  # noqa: B023
        until(is_served, "the console after kills", STARTS_S)
        assert "TIAGo 42" in browser.page("/robots/tiago-42/")
        assert nobody_listens(2019) and nobody_listens(6379)
        compose("exec", "-T", "caddy", "caddy", "reload", "--config", "/etc/caddy/Caddyfile")
        is_upgraded(compose, policy)
        is_restored(compose)
        # The work of podman-restart.service before and after a boot, in no order.
        compose.podman("stop", "--all", "--filter", "restart-policy=always")
        compose.podman("start", "--all", "--filter", "restart-policy=always")
        until(is_served, "the console after a boot", STARTS_S)
        assert "TIAGo 42" in Browser().page("/robots/tiago-42/")


def commands(row: str) -> list[list[str]]:
    """Return the words of each podman-compose of a row of the page."""
    [line] = re.findall(rf"^\| {row} \|.*$", PAGE, re.MULTILINE)
    return [shlex.split(words) for words in re.findall(r"`podman-compose ([^`]*)`", line)]


def is_upgraded(compose: Compose, policy: tuple[str, Path]) -> None:
    """Build an image that is newer by a commit and a migration, and follow the page."""
    newer = buildah("from", "--pull-never", IMAGE)
    state = "/opt/fleet/fleet/audit/migrations"
    last = buildah("run", newer, "--", "sh", "-c", f"cd {state}; ls 0*.py | tail -n 1").removesuffix(".py")
    text = f"from django.db import migrations as m\nclass Migration(m.Migration): dependencies = [('audit', {last!r})]"
    buildah("run", "--user", "root", newer, "--", "sh", "-c", f'echo "$0" >{state}/9999_newer.py', text)
    buildah("config", "--env", "FLEET_COMMIT=fedcba9876", newer)
    buildah("commit", "--quiet", *policy, newer, IMAGE)
    for words in commands("upgrade"):
        compose(*words)
    until(is_served, "the console after the upgrade", STARTS_S)
    assert "fedcba9876" in compose("exec", "-T", "console", ".venv/bin/python", "manage.py", "version")


def is_restored(compose: Compose) -> None:
    """Make a backup, sign in, and go back: the session that is newer than the backup is gone."""
    [backup] = commands(r"\[backup\]\(backup.md\)")
    compose(*backup[:1], "-T", *backup[1:])
    browser = Browser()
    assert "TIAGo 42" in browser.page("/robots/tiago-42/")
    newest = compose("exec", "-T", "console", "ls", "-t", "/var/backups/fleet").split()[0]
    for words in commands("restore"):
        compose(*(word.replace("FILE", newest) for word in words))
    until(is_served, "the console after the restore", STARTS_S)
    with pytest.raises(urllib.error.HTTPError, match="401"):
        browser.page("/robots/tiago-42/")
    assert "TIAGo 42" in Browser().page("/robots/tiago-42/")


def nobody_listens(port: int) -> bool:
    """Return whether nobody listens at this port of the computer."""
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
        return False
    return True


def web_process(compose: Compose) -> int:
    """Return the process id of the console's web process here; 0 if there is none."""
    with suppress(ValueError):
        return Family(compose.pid("console")).named("fleet.server --verbosity")
    return 0


def is_served() -> bool:
    """Return whether the console answers through Caddy."""
    try:
        with urllib.request.urlopen(f"{SITE}/healthz", timeout=PAGE_S):  # noqa: S310
            return True
    except OSError:
        return False


class Browser:
    """The first admin's browser, signed in through Caddy."""

    url, port, hosts, certificate = SITE, 443, ("localhost",), None  # SSL_CERT_FILE has the authority
    accounts = {STAFF.username: STAFF}

    def __init__(self) -> None:
        self._cookie = sign_in(self, STAFF.username)

    def page(self, path: str) -> str:
        request = urllib.request.Request(f"{SITE}{path}", headers={"Cookie": self._cookie})  # noqa: S310
        with urllib.request.urlopen(request, timeout=PAGE_S) as page:  # noqa: S310
            shown: str = page.read().decode()
            return shown
