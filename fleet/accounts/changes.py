"""Record changes of accounts: by the admin, by the owner's pages, from the command line."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from fleet.audit import actor_renamed, record
from fleet.audit.command_line import here

if TYPE_CHECKING:
    from fleet.accounts.models import User

SHOWN = ("username", "full_name", "email", "is_active", "is_staff", "is_superuser")
RECORDED = (*SHOWN, "password")  # of a password only that it changed
RIGHTS = ("is_active", "is_staff", "is_superuser")  # on record for ever; all else says who somebody is


def between(before: User, person: User, fields: Collection[str]) -> list[dict[str, Any]]:
    """Which of these fields have other values than before. To be asked before they are saved."""
    changes: list[dict[str, Any]] = [
        {"field": name, "from": getattr(before, name), "to": getattr(person, name)}
        for name in SHOWN
        if name in fields and getattr(person, name) != getattr(before, name)
    ]
    if "password" in fields and _password_changed(before, person):
        changes.append({"field": "password"})
    return changes


def made(person: User, changes: list[dict[str, Any]]) -> None:
    """Record a new account, by what differs from a blank one."""
    _record("account.create", person, changes)


def changed(person: User, changes: list[dict[str, Any]]) -> None:
    """Record a change, if it is one."""
    if not changes:
        return
    _record("account.change", person, changes)
    if {"username", "full_name"} & {change["field"] for change in changes}:
        actor_renamed(person)


def deleted(person: User) -> None:
    """Record an account that goes. The admin deletes none; a program may."""
    _record("account.delete", person, [])


def _password_changed(before: User, person: User) -> bool:
    """Whether it is another password, and not the same one under a newer hash, which Django writes at sign-in."""
    if person.password == before.password:
        return False
    typed = person._password is not None  # type: ignore[attr-defined]  # from `set_password` until it is saved
    return typed or not person.has_usable_password() or not before.has_usable_password()


def _record(kind: str, person: User, changes: list[dict[str, Any]]) -> None:
    """Which fields, and of rights the values, are kept for ever; names and addresses are not."""
    kept = [change if change["field"] in RIGHTS else {"field": change["field"]} for change in changes]
    told: dict[str, Any] = {"changes": kept} if changes else {}
    whole: dict[str, Any] = {"changes": changes} if kept != changes else {}
    record(
        kind,
        actor=person.changed_by or here(),
        parameters={"user": str(person.pk), **told},
        private={"name": person.display_name, **whole},
    )
