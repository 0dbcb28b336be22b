"""Shipped profiles follow their files until a person edits them."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import pytest
import yaml

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.registry.models import RobotProfile
from robots.registry.services import profile_take_shipped, profiles_load_shipped
from robots.registry.shipped_profiles import DIRECTORY, profile_files

pytestmark = pytest.mark.django_db


@pytest.fixture
def update(tmp_path: Path) -> Path:
    """Return a folder with a later version of the shipped files, in which TIAGo turns more slowly."""
    for file in DIRECTORY.glob("*.yaml"):
        content = yaml.safe_load(file.read_text())
        if content["slug"] == "tiago":
            content["limits"]["turn_radps"] = 1.5
        (tmp_path / file.name).write_text(yaml.safe_dump(content))
    shutil.copy(DIRECTORY / "phrases.txt", tmp_path)
    return tmp_path


@pytest.fixture
def more_phrases(update: Path) -> Path:
    """Return a folder with a later version of the shipped files, with one more phrase."""
    with (update / "phrases.txt").open("a", encoding="utf-8") as phrases:
        phrases.write("it-IT\tBuongiorno!\n")
    return update


def texts(profile: RobotProfile) -> list[str]:
    return list(profile.phrases.values_list("text", flat=True))


def test_an_update_reaches_an_unedited_profile(tiago: RobotProfile, update: Path) -> None:
    profiles_load_shipped(directory=update)
    tiago.refresh_from_db()
    assert tiago.turn_radps == 1.5


def test_an_update_of_limits_is_recorded_once(tiago: RobotProfile, update: Path) -> None:
    profiles_load_shipped(directory=update)
    profiles_load_shipped(directory=update)
    (record,) = Record.objects.filter(kind="profile.change", parameters__profile="tiago")
    assert record.actor_id is None
    assert record.parameters == {
        "profile": "tiago",
        "changes": [{"field": "turn_radps", "from": 2.0944, "to": 1.5}],
    }


def test_shipped_data_is_recorded_from_the_start(tmp_path: Path) -> None:
    content = yaml.safe_load((DIRECTORY / "tiago.yaml").read_text())
    (tmp_path / "new.yaml").write_text(yaml.safe_dump({**content, "slug": "tiago-new", "phrases": None}))
    profiles_load_shipped(directory=tmp_path)
    profiles_load_shipped(directory=tmp_path)
    (record,) = Record.objects.filter(kind="profile.create", parameters__slug="tiago-new")
    assert record.actor_id is None
    assert record.parameters["turn_radps"] == 2.0944


def test_an_update_leaves_an_edited_profile_alone_and_says_so(
    tiago: RobotProfile, update: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tiago.blind_mps = 0.1
    tiago.save()
    with caplog.at_level(logging.WARNING, "robots.registry.services"):
        profiles_load_shipped(directory=update)
    tiago.refresh_from_db()
    assert (tiago.turn_radps, tiago.blind_mps) == (2.0944, 0.1)
    assert "tiago was edited here" in caplog.text


def test_a_deleted_shipped_profile_comes_back(tiago: RobotProfile) -> None:
    tiago.delete()
    profiles_load_shipped()
    assert RobotProfile.objects.filter(slug="tiago").exists()


def test_a_speaking_profile_has_24_phrases_in_six_languages(tiago: RobotProfile) -> None:
    phrases = list(tiago.phrases.all())
    languages = list(dict.fromkeys(phrase.language for phrase in phrases))
    assert (len(phrases), languages) == (24, tiago.topics["languages"])
    assert "مرحبًا! سعدتُ بلقائكم." in texts(tiago)
    for phrase in phrases:
        phrase.full_clean()
    assert not RobotProfile.objects.get(slug="pmb2").phrases.exists()


def test_new_phrases_of_an_update_are_added_once_and_recorded(
    tiago: RobotProfile, more_phrases: Path
) -> None:
    profiles_load_shipped(directory=more_phrases)
    profiles_load_shipped(directory=more_phrases)
    assert texts(tiago)[-1] == "Buongiorno!"
    assert tiago.phrases.count() == 25
    record = Record.objects.filter(kind="phrase.import", parameters__profile="tiago").latest("id")
    assert record.parameters["profile"] == "tiago"
    assert record.details["added"] == [{"text": "Buongiorno!", "language": "it-IT", "tags": []}]
    assert Record.objects.filter(kind="phrase.import", parameters__profile="tiago").count() == 2


def test_phrases_that_were_edited_here_stay_so(
    tiago: RobotProfile, more_phrases: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tiago.phrases.filter(language="ca-ES").delete()
    with caplog.at_level(logging.WARNING, "robots.registry.services"):
        profiles_load_shipped(directory=more_phrases)
    assert tiago.phrases.count() == 20
    assert "Phrases of profile tiago were edited here" in caplog.text


def test_phrases_that_were_deleted_here_do_not_come_back(tiago: RobotProfile) -> None:
    tiago.phrases.all().delete()
    profiles_load_shipped()
    assert not tiago.phrases.exists()


def test_taking_the_shipped_version_includes_its_phrases(tiago: RobotProfile, staff: User) -> None:
    tiago.phrases.all().delete()
    assert profile_take_shipped(profile=tiago, actor=staff)
    (file,) = (file for file in profile_files() if file.slug == "tiago")
    assert [phrase.line for phrase in tiago.phrases.all()] == file.phrase_lines()
