"""Writing to the registry. Every change is checked, written and recorded in one transaction."""

from __future__ import annotations

import logging
import socket
from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict
from uuid import UUID

from django.db import models, transaction
from django.utils import timezone
from msgspec import convert, to_builtins

from fleet.audit.command_line import SystemAccount, here
from fleet.audit.services import record
from robots.link import stop_courier as courier
from robots.registry import shipped_profiles
from robots.registry.models import Allowance, BridgeStatus, Phrase, Robot, RobotProfile
from robots.registry.phrases import Line, tags_text
from robots.shared.sentences import Sentence

if TYPE_CHECKING:
    from fleet.accounts.models import User

    Actor = User | SystemAccount | None  # None: the console itself

log = logging.getLogger(__name__)
# Columns that people do not fill in, or that the record already contains.
NOT_ENTERED = {"id", "fence", "updated_at", "shipped", "shipped_phrases", "robot"}
WORDS = "text"  # of a phrase
LONGEST_DETAIL = 500  # of a bridge's status
LONGEST_HOST = 64  # the same
ORDER_STEP = 10  # between phrases of a file, to leave room for others


@transaction.atomic
def robot_save(*, robot: Robot, actor: Actor) -> Robot:
    """Create `robot` or save its changes; raise `ValidationError` if it is not valid."""
    robot.full_clean()
    if robot._state.adding:
        robot.save(force_insert=True)
        record("robot.create", actor=actor, **named(robot), parameters=_entered(robot))
    elif changes := _save_changes(robot, Robot.objects.select_for_update(no_key=True).get(pk=robot.pk)):
        record("robot.change", actor=actor, **named(robot), parameters={"changes": changes})
    return robot


@transaction.atomic
def robot_copy(*, robot: Robot, name: str, slug: str, actor: Actor) -> Robot:
    """Make a robot with the same settings, disabled. Roles, phrases and topics are not copied."""
    own = {"id", "name", "slug", "enabled", "bridge_address", "fence", "updated_at"}
    same = {
        field.attname: getattr(robot, field.attname)
        for field in robot._meta.concrete_fields
        if field.name not in own
    }
    return robot_save(robot=Robot(name=name, slug=slug, enabled=False, **same), actor=actor)


@transaction.atomic
def robot_delete(*, robot: Robot, actor: Actor) -> None:
    """Delete a robot for good. Raises `ProtectedError`: it was booked or driven, so the log refers to it."""
    robot.deleted_by = actor
    robot.delete()


def robot_deleted(robot: Robot) -> None:
    """Record who deleted a robot, or the account that runs this process, and drop the robot's pending stops."""
    record("robot.delete", actor=robot.deleted_by or here(), **named(robot), parameters=_entered(robot))
    transaction.on_commit(partial(courier.forget, robot.id))


@transaction.atomic
def profile_save(*, profile: RobotProfile, actor: Actor) -> RobotProfile:
    """Create `profile` or save its changes; raise `ValidationError` if it is not valid."""
    profile.full_clean()
    if profile._state.adding:
        profile.save(force_insert=True)
        record("profile.create", actor=actor, parameters=_entered(profile))
    elif changes := _save_changes(profile, RobotProfile.objects.select_for_update().get(pk=profile.pk)):
        record("profile.change", actor=actor, parameters={"profile": profile.slug, "changes": changes})
    return profile


@transaction.atomic
def profile_delete(*, profile: RobotProfile, actor: Actor) -> None:
    """Delete a profile; raise `ProtectedError` if a robot uses it."""
    record("profile.delete", actor=actor, parameters=_entered(profile))
    profile.delete()


@transaction.atomic
def profile_take_shipped(*, profile: RobotProfile, actor: Actor) -> bool:
    """Replace local edits by the shipped profile; return False if there is no shipped version."""
    file = shipped_profiles.file_of(profile)
    if file is None:
        return False
    _take(profile, file, actor)
    _take_phrases(profile, file.phrase_lines(), actor)
    return True


@transaction.atomic
def profiles_load_shipped(*, directory: Path = shipped_profiles.DIRECTORY) -> None:
    """Create and update profiles from the shipped files, except edited profiles."""
    for file in shipped_profiles.profile_files(directory):
        profile = RobotProfile.objects.filter(slug=file.slug).first()
        if profile is None:
            profile = RobotProfile(slug=file.slug)
            shipped_profiles.fill(profile, file)
            profile_save(profile=profile, actor=None)
        elif shipped_profiles.is_edited(profile) and shipped_profiles.differs(profile, file):
            log.warning("Profile %s was edited here; the shipped one differs and was not taken.", file.slug)
        elif profile.shipped != file.columns():
            _take(profile, file, actor=None)
        _load_phrases(profile, file.phrase_lines(directory))


def _load_phrases(profile: RobotProfile, lines: list[Line]) -> None:
    """Update a profile's phrases from the file, unless they were edited here."""
    last = convert(profile.shipped_phrases, list[Line])
    if last == lines:
        return
    if [phrase.line for phrase in profile.phrases.all()] in (last, lines):
        _take_phrases(profile, lines, actor=None)
    else:
        log.warning("Phrases of profile %s were edited here; the shipped ones were not taken.", profile.slug)


def _take_phrases(profile: RobotProfile, lines: list[Line], actor: Actor) -> None:
    """Replace a stored profile's phrases by those of the file."""
    phrases_import(owner=profile, lines=lines, actor=actor, replace=True)
    profile.shipped_phrases = to_builtins(lines)
    profile.save(update_fields=["shipped_phrases"])


def _take(profile: RobotProfile, file: shipped_profiles.ProfileFile, actor: Actor) -> None:
    """Set a stored profile from `file`."""
    shipped_profiles.fill(profile, file)
    profile_save(profile=profile, actor=actor)
    profile.save(update_fields=["shipped"])


class _Named(TypedDict, total=False):
    robot_id: UUID
    robot_name: str


def named(robot: Robot | None) -> _Named:
    """Return the arguments that name a robot in a record; none for no robot."""
    return {"robot_id": robot.id, "robot_name": robot.name} if robot else {}


def _save_changes(entry: models.Model, stored: models.Model) -> list[dict[str, Any]]:
    """Save only changed fields, and return the changes: a form that was open for long must not restore an old fence."""
    before, after = _entered(stored), _entered(entry)
    changed = [name for name in after if after[name] != before[name]]
    if changed:
        saved_at = ["updated_at"] if hasattr(entry, "updated_at") else []
        entry.save(update_fields=[*changed, *saved_at])
    return [{"field": name, "from": before[name], "to": after[name]} for name in changed]


def _entered(entry: models.Model) -> dict[str, Any]:
    """Return the columns that people fill in, as JSON values."""
    return {
        field.name: field.value_from_object(entry)
        for field in entry._meta.concrete_fields
        if field.name not in NOT_ENTERED
    }


@transaction.atomic
def entry_save(*, entry: Phrase | Allowance, actor: Actor) -> None:
    """Create an entry of a profile or robot, or save its changes; raise `ValidationError` if it is not valid."""
    entry.full_clean()
    if entry._state.adding:
        entry.save(force_insert=True)
        _record_entry("create", entry, _entered(entry), actor)
    elif changes := _save_changes(entry, type(entry)._default_manager.select_for_update().get(pk=entry.pk)):
        _record_entry_change(entry, changes, actor)


def phrases_lock(keys: Collection[int]) -> None:
    """Lock phrases until the commit, after their profiles and robots, each table in the order of its keys.

    For a list that saves several: people who save lists in opposite orders wait for each other, and none is refused.
    """
    phrases = Phrase.objects.filter(pk__in=keys)
    for owners, column in ((RobotProfile.objects, "profile"), (Robot.objects, "robot")):
        found = owners.filter(pk__in=phrases.values(column))
        list(found.select_for_update(no_key=True).order_by("pk").values_list("pk", flat=True))
    list(phrases.select_for_update().order_by("pk").values_list("pk", flat=True))


@transaction.atomic
def entry_delete(*, entry: Phrase | Allowance, actor: Actor) -> None:
    """Delete an entry of a profile or robot."""
    _record_entry("delete", entry, _entered(entry), actor)
    entry.delete()


def _record_entry(verb: str, entry: Phrase | Allowance, columns: dict[str, Any], actor: Actor) -> None:
    """Record a new or deleted entry. The text of a phrase may expire in the audit log, like spoken texts."""
    facts = {name: value for name, value in columns.items() if name != WORDS}
    record(
        f"{entry._meta.model_name}.{verb}",
        actor=actor,
        text=columns.get(WORDS, ""),
        **_of(entry.owner, facts),
    )


def _record_entry_change(entry: Phrase | Allowance, changes: list[dict[str, Any]], actor: Actor) -> None:
    """Record changes. The text of a phrase may expire in the audit log, but not the fact that it was changed."""
    if isinstance(entry, Allowance):
        facts = {"entry": f"{entry.what} {entry.name}", "changes": changes}
        record("allowance.change", actor=actor, **_of(entry.owner, facts))
        return
    kept = [{"field": WORDS} if change["field"] == WORDS else change for change in changes]
    record(
        "phrase.change",
        actor=actor,
        text=entry.text,
        private={"changes": changes},
        **_of(entry.owner, {"language": entry.language, "changes": kept}),
    )


@transaction.atomic
def phrases_import(
    *,
    owner: RobotProfile | Robot,
    lines: list[Line],
    actor: Actor,
    replace: bool = False,
) -> int:
    """Add the new phrases of a file after those of `owner`; with `replace`, delete the old phrases first.

    Returns how many phrases are new.
    """
    type(owner)._default_manager.select_for_update().get(slug=owner.slug)  # one import at a time
    held = [phrase.line for phrase in owner.phrases.all()]
    if replace and held == lines:
        return 0
    if replace:
        owner.phrases.all().delete()
    known = set() if replace else {(line.language, line.text) for line in held}
    wanted = [line for line in lines if (line.language, line.text) not in known]
    last = max(owner.phrases.values_list("order", flat=True), default=0)
    Phrase.objects.bulk_create(_phrases(owner, wanted, last))
    added = [line for line in wanted if line not in held]
    removed = [line for line in held if line not in wanted] if replace else []
    if wanted or removed:
        figures = {"replaced": replace, "added": len(added), "removed": len(removed)}
        lists = {"added": to_builtins(added), "removed": to_builtins(removed)}
        record("phrase.import", actor=actor, private=lists, **_of(owner, figures))
    return len(added)


def _phrases(owner: RobotProfile | Robot, lines: list[Line], after: int) -> Iterator[Phrase]:
    whose = "robot" if isinstance(owner, Robot) else "profile"
    for number, line in enumerate(lines, start=1):
        yield Phrase(
            **{whose: owner},
            text=line.text,
            language=line.language,
            tags=tags_text(line.tags),
            order=after + number * ORDER_STEP,
        )


class _Of(TypedDict, total=False):
    robot_id: UUID
    robot_name: str
    parameters: dict[str, Any]


def _of(owner: RobotProfile | Robot, parameters: dict[str, Any]) -> _Of:
    """Return what a record stores of an entry and its owner."""
    if isinstance(owner, Robot):
        return {**named(owner), "parameters": parameters}
    return {"parameters": {**parameters, "profile": owner.slug}}


@transaction.atomic
def fence_next(robot: Robot, at_least: int = 0) -> int:
    """Return a new fence, higher than all fences so far and than `at_least` (the highest that the bridge received)."""
    given = Robot.objects.select_for_update(no_key=True).values_list("fence", flat=True).get(pk=robot.pk)
    fence = max(given, at_least) + 1
    Robot.objects.filter(pk=robot.pk).update(fence=fence)
    return fence


def bridge_status_set(*, robot_id: UUID, state: BridgeStatus.State, detail: str, pid: int | None) -> None:
    """Save the state that a bridge process has from now on. Does nothing for a deleted robot."""
    said = detail.parts if isinstance(detail, Sentence) and len(detail) <= LONGEST_DETAIL else []
    if Robot.objects.filter(pk=robot_id).exists():
        BridgeStatus.objects.update_or_create(
            robot_id=robot_id,
            defaults={
                "state": state,
                "detail": detail[:LONGEST_DETAIL],
                "said": said,
                "pid": pid,
                "host": socket.gethostname()[:LONGEST_HOST],
                "since": timezone.now(),
            },
        )
