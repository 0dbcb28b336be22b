"""The image of the console, built and run as docs/containers.md says; the base is made here instead of downloaded."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from script.stack.places import REPOSITORY
from script.stack.processes import Child
from script.stack.serve import arguments
from script.stack.stack import Account
from tests.processes import free_port, outside, until
from tests.script.first_run import set_up
from tests.script.installed.machine import INSTALLED_S, TRUSTED, empty_root, missing
from tests.script.support import Family

DEPLOY = REPOSITORY / "deploy"
STAFF = Account("first", "staff", "a long walk on the beach")
STARTS_S = 120.0
ENDED_S = 30.0
USER = 900  # of the image, not root
BASE, IMAGE = "localhost/fleet-test-base", "localhost/fleet-test"


def test_compose_starts_roles_that_exist_behind_its_proxy() -> None:
    services: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())["services"]
    consoles = [one for one in services.values() if one["image"] == "fleet"]
    assert [arguments(one["command"]).role for one in consoles] == ["console"]
    for one in consoles:
        assert arguments(one["healthcheck"]["test"][2:]).is_ready
        assert one["cap_drop"] == ["ALL"] and one["read_only"]
    port = arguments(consoles[0]["command"]).port
    assert f"reverse_proxy 127.0.0.1:{port} " in (DEPLOY / "Caddyfile").read_text()
    for name in ("database", "redis"):
        assert all(port.startswith("127.0.0.1:") for port in services[name]["ports"])  # of this computer only


def test_the_image_has_all_files_and_runs_as_its_own_user() -> None:
    steps = (DEPLOY / "Containerfile").read_text()
    for copied in re.findall(r"^COPY (.*) \S+$", steps, re.MULTILINE):
        assert all((REPOSITORY / name).exists() for name in copied.split())
    assert re.findall(r"^USER (\S+)$", steps, re.MULTILINE) == ["fleet"]
    assert re.search(r'^ENTRYPOINT \[.*"script/serve"\]$', steps, re.MULTILINE)
    assert re.search(r'^CMD \["console"\]$', steps, re.MULTILINE)


def test_secrets_and_data_stay_out_of_the_image() -> None:
    """Docker reads only this file, podman and buildah read it, too."""
    assert {"var", "**/.env"} <= set((REPOSITORY / ".dockerignore").read_text().splitlines())
    assert not (REPOSITORY / ".containerignore").exists()  # podman would prefer it


def buildah(*words: str | Path, **options: Any) -> str:
    command = ["buildah", *map(str, words)]
    done = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=INSTALLED_S, **options
    )
    assert done.returncode == 0, f"{' '.join(command)}:\n{done.stdout[-5000:]}"
    return done.stdout.strip()


@pytest.fixture
def image(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The built image, in a storage of its own."""
    (tmp_path / "storage.conf").write_text(
        f'[storage]\ndriver = "overlay"\ngraphroot = "{tmp_path}/images"\nrunroot = "{tmp_path}/run"\n'
    )
    (tmp_path / "policy.json").write_text('{"default": [{"type": "insecureAcceptAnything"}]}')
    monkeypatch.setenv("CONTAINERS_STORAGE_CONF", str(tmp_path / "storage.conf"))
    monkeypatch.setenv("BUILDAH_ISOLATION", "chroot")
    base = buildah("from", "scratch")
    buildah("add", "--quiet", base, empty_root(), "/")
    buildah("copy", "--quiet", base, TRUSTED, TRUSTED)
    for name in ("PIP_CERT", "NODE_EXTRA_CA_CERTS"):
        buildah("config", "--env", f"{name}={TRUSTED}", base)
    policy = ("--signature-policy", tmp_path / "policy.json")
    buildah("commit", "--quiet", *policy, base, BASE)
    build = [
        "--file",
        DEPLOY / "Containerfile",
        "--build-arg",
        f"BASE={BASE}",
        "--build-arg",
        "COMMIT=0123456789",
    ]
    buildah("build", "--network", "host", "--pull-never", *policy, *build, "--tag", IMAGE, REPOSITORY)
    yield IMAGE
    buildah("rm", "--all")
    buildah("rmi", "--all", "--force")


@pytest.mark.timeout(INSTALLED_S)
@pytest.mark.skipif(bool(missing("buildah")), reason=missing("buildah"))
def test_the_image_is_built_and_runs_as_a_console(image: str, tmp_path: Path) -> None:
    port = free_port()
    container = buildah("from", "--pull-never", image)
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
