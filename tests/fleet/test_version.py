"""The release is the same everywhere: page, error page, API, metrics, log, command."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from django.test import Client

from fleet.base import version
from script.stack.places import REPOSITORY
from tests.processes import outside

COMMIT = "0123456789"


@pytest.fixture
def image(monkeypatch: pytest.MonkeyPatch) -> str:
    """The release in an image, which has no git."""
    version.commit.cache_clear()
    monkeypatch.setenv("FLEET_COMMIT", f"{COMMIT}abcdef")
    yield version.release()
    version.commit.cache_clear()


@pytest.mark.django_db
def test_pages_api_and_metrics_show_one_release(image, staff, signed_in):
    assert image == f"{version.version()} ({COMMIT})"
    client = signed_in(staff)
    page = client.get("/about/").text
    assert version.version() in page
    assert COMMIT in page
    assert image in Client().get("/nowhere/").text
    assert image in client.get("/help/no/such/page/").text
    entry = client.get("/api/v1/").json()
    assert (entry["version"], entry["commit"]) == (version.version(), COMMIT)
    metrics = client.get("/metrics?").text
    assert f'fleet_build_info{{commit="{COMMIT}",version="{version.version()}"}} 1.0' in metrics


def test_manage_py_says_the_release():
    command = [sys.executable, "manage.py", "version"]
    done = subprocess.run(command, cwd=REPOSITORY, env=outside(), capture_output=True, text=True)
    assert done.stdout.strip() == version.release()


def test_python_writes_a_candidate_in_another_way(monkeypatch, tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "2.1.0rc3"\n')
    monkeypatch.setattr(version, "ROOT", tmp_path)
    version.version.cache_clear()
    version.commit.cache_clear()
    assert version.release() == "2.1.0-rc3"
    version.version.cache_clear()
    version.commit.cache_clear()


def test_changes_and_upgrade_notes_have_this_version():
    (newest,) = re.findall(r"^## \[([^]]*)\]", (REPOSITORY / "CHANGELOG.md").read_text(), re.MULTILINE)[:1]
    page = (REPOSITORY / "docs" / "upgrade.md").read_text()
    (noted,) = re.findall(r"^### (.*)$", page, re.MULTILINE)[:1]
    assert newest in ("Unreleased", version.version())
    assert noted == version.version()
    assert f"git checkout v{noted}`" in page
    assert '"version"' not in (REPOSITORY / "package.json").read_text()
