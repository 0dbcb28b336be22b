"""Shipped profiles follow their files until somebody edits them."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest
import yaml

from fleet.audit.models import Record
from robots.models import RobotProfile
from robots.services import profiles_load_shipped
from robots.shipped import DIRECTORY

pytestmark = pytest.mark.django_db


@pytest.fixture
def update(tmp_path: Path) -> Path:
    """The files of a later version of the console: TIAGo turns more slowly."""
    for file in DIRECTORY.glob("*.yaml"):
        content = yaml.safe_load(file.read_text())
        if content["slug"] == "tiago":
            content["limits"]["turn_radps"] = 1.5
        (tmp_path / file.name).write_text(yaml.safe_dump(content))
    return tmp_path


def test_an_update_reaches_a_profile_that_nobody_edited(tiago: RobotProfile, update: Path) -> None:
    profiles_load_shipped(directory=update)
    tiago.refresh_from_db()
    assert tiago.turn_radps == 1.5


def test_an_update_that_changes_limits_is_on_record_once(tiago: RobotProfile, update: Path) -> None:
    profiles_load_shipped(directory=update)
    profiles_load_shipped(directory=update)
    (record,) = Record.objects.filter(kind="profile.change")
    assert record.actor_id == ""
    assert record.parameters == {
        "profile": "tiago",
        "changes": [{"field": "turn_radps", "from": 2.0944, "to": 1.5}],
    }


def test_what_the_console_brings_along_is_on_record_from_the_start(tmp_path: Path) -> None:
    content = yaml.safe_load((DIRECTORY / "tiago.yaml").read_text())
    (tmp_path / "new.yaml").write_text(yaml.safe_dump({**content, "slug": "tiago-new"}))
    profiles_load_shipped(directory=tmp_path)
    profiles_load_shipped(directory=tmp_path)
    (record,) = Record.objects.filter(kind="profile.create", parameters__slug="tiago-new")
    assert record.actor_id == ""
    assert record.parameters["turn_radps"] == 2.0944


def test_an_update_leaves_an_edited_profile_alone_and_says_so(
    tiago: RobotProfile, update: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tiago.blind_mps = 0.1
    tiago.save()
    with caplog.at_level(logging.WARNING, "robots.services"):
        profiles_load_shipped(directory=update)
    tiago.refresh_from_db()
    assert (tiago.turn_radps, tiago.blind_mps) == (2.0944, 0.1)
    assert "tiago was edited here" in caplog.text


def test_a_deleted_shipped_profile_comes_back(tiago: RobotProfile) -> None:
    tiago.delete()
    profiles_load_shipped()
    assert RobotProfile.objects.filter(slug="tiago").exists()
