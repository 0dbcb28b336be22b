"""Images for containers, made here instead of downloaded: the console's, and stand-ins for its servers."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from script.stack.places import REPOSITORY
from tests.script.installed.machine import INSTALLED_S, TRUSTED, empty_root

DEPLOY = REPOSITORY / "deploy"
BASE, IMAGE, SERVERS = "localhost/fleet-test-base", "localhost/fleet", "localhost/fleet-test-servers"
# Each begins as the entry of the image whose name it has.
STAND_INS = {
    "docker.io/library/postgres:15": """#!/bin/bash
set -e
data=/var/lib/postgresql/data
as() { setpriv --reuid postgres --regid postgres --init-groups "$@"; }
install -d -o postgres /run/postgresql
chown postgres $data && chmod 700 $data
PATH=$PATH:/usr/lib/postgresql/15/bin
if [[ ! -s $data/PG_VERSION ]]; then
    install -m 600 -o postgres <(echo "$POSTGRES_PASSWORD") /tmp/password
    as initdb -D $data -U "$POSTGRES_USER" --pwfile=/tmp/password --encoding=UTF8 $POSTGRES_INITDB_ARGS
    echo "host all all all scram-sha-256" >>$data/pg_hba.conf
    as pg_ctl -D $data -w -o "-c listen_addresses=''" start
    as createdb -U "$POSTGRES_USER" "$POSTGRES_USER"
    as pg_ctl -D $data -w stop
fi
exec setpriv --reuid postgres --regid postgres --init-groups "$@" -D $data
""",
    "docker.io/library/redis:7": """#!/bin/sh
chown redis /data
exec setpriv --reuid redis --regid redis --init-groups "$@" --protected-mode no
""",
    "docker.io/library/caddy:2": """#!/bin/sh
export XDG_DATA_HOME=/data XDG_CONFIG_HOME=/config
exec caddy run --config /etc/caddy/Caddyfile --adapter caddyfile
""",
}


def buildah(*words: str | Path, **options: Any) -> str:
    command = ["buildah", *map(str, words)]
    done: subprocess.CompletedProcess[str] = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=INSTALLED_S, **options
    )
    assert done.returncode == 0, f"{' '.join(command)}:\n{done.stdout[-5000:]}"
    return done.stdout.strip()


@contextmanager
def storage(place: Path) -> Iterator[tuple[str, Path]]:
    """Keep images in this folder only, and make the base. Yield the words that trust images without signatures."""
    (place / "storage.conf").write_text(
        f'[storage]\ndriver = "overlay"\ngraphroot = "{place}/images"\nrunroot = "{place}/run"\n'
    )
    (place / "policy.json").write_text('{"default": [{"type": "insecureAcceptAnything"}]}')
    settings = {"CONTAINERS_STORAGE_CONF": str(place / "storage.conf"), "BUILDAH_ISOLATION": "chroot"}
    policy = ("--signature-policy", place / "policy.json")
    with patch.dict(os.environ, settings):
        base = buildah("from", "scratch")
        buildah("add", "--quiet", base, empty_root(), "/")
        buildah("copy", "--quiet", base, TRUSTED, TRUSTED)
        for name in ("PIP_CERT", "NODE_EXTRA_CA_CERTS"):
            buildah("config", "--env", f"{name}={TRUSTED}", base)
        buildah("commit", "--quiet", *policy, base, BASE)
        try:
            yield policy
        finally:
            buildah("rm", "--all")
            buildah("rmi", "--all", "--force")


def build_console(policy: tuple[str, Path]) -> None:
    """Build the console's image as docs/containers.md says."""
    build: list[str | Path] = ["--file", DEPLOY / "Containerfile", "--build-arg", f"BASE={BASE}"]
    build += ["--build-arg", "COMMIT=0123456789", "--tag", IMAGE, REPOSITORY]
    buildah("build", "--network", "host", "--pull-never", *policy, *build)


def build_servers(policy: tuple[str, Path], place: Path) -> None:
    """Make PostgreSQL, Redis and Caddy of Debian into images with the names of compose.yaml."""
    server = buildah("from", "--pull-never", BASE)
    install = "apt-get update && apt-get install -y --no-install-recommends postgresql redis-server caddy"
    buildah("run", "--network", "host", server, "--", "sh", "-c", install)
    for image, entry in STAND_INS.items():
        (place / "entry").write_text(entry)
        buildah("copy", "--quiet", "--chmod", "755", server, place / "entry", "/entry")
        buildah("config", "--entrypoint", '["/entry"]', "--cmd", "", server)
        buildah("commit", "--quiet", *policy, server, image)
