"""Record changes of accounts, which come from the admin, from the owner's pages or from the command line."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from django.contrib.auth.models import AbstractUser
from django.db import transaction
from django.dispatch import Signal

from fleet.audit.command_line import SystemAccount, here
from fleet.audit.services import RecordBody, actor_renamed, record, record_all

SHOWN = (
    "username",
    "full_name",
    "email",
    "time_zone",
    "language",
    "project",
    "is_active",
    "is_staff",
    "is_superuser",
)
RECORDED = (*SHOWN, "password")  # the record says that the password changed, and does not contain it
# Their values are kept as long as the record; values of the other fields are personal data and expire
RIGHTS = ("is_active", "is_staff", "is_superuser")


# Arguments: user, actor. Sent when somebody else sets or removes an account's password, in that transaction.
password_set_by_another = Signal()


class RecordedUser(AbstractUser):
    """An account whose changes are recorded. A change that cannot be recorded is not saved."""

    changed_by: AbstractUser | None = None  # the person who saves this next; None: the command line

    class Meta(AbstractUser.Meta):
        abstract = True

    def save(self, **options: Any) -> None:
        """Save, and record the changes."""
        fields = options.get("update_fields") or RECORDED
        if set(fields).isdisjoint(RECORDED):  # such as the time of the last sign-in
            super().save(**options)
            return
        with transaction.atomic():
            new = self._state.adding
            # no_key: others may store rows that refer to this account, such as a booking, without waiting
            before = (
                type(self)() if new else type(self).objects.select_for_update(no_key=True).get(pk=self.pk)
            )
            changes = _changes(before, self, fields)
            super().save(**options)
            if new:
                _record("account.create", self, changes)  # the differences from a blank account
            elif changes:
                _record("account.change", self, changes)
                changed = {change["field"] for change in changes}
                if "email" in changed:  # allauth keeps its own list of addresses, with "verified"
                    self.emailaddress_set.exclude(email=self.email).delete()  # type: ignore[attr-defined]
                if {"username", "full_name"} & changed:
                    actor_renamed(self)
                if "password" in changed and self.changed_by != self:
                    actor = self.changed_by or here()
                    password_set_by_another.send(sender=type(self), user=self, actor=actor)

    def record_deletion(self) -> None:
        """Record that the account is deleted. The admin site deletes no accounts; Python code can."""
        _record("account.delete", self, [])


def record_creations(people: Sequence[RecordedUser], actor: AbstractUser | SystemAccount | None) -> None:
    """Record new accounts that were stored together in bulk, without `save`."""
    bodies = [_body(person, _changes(type(person)(), person, RECORDED)) for person in people]
    record_all("account.create", bodies, actor=actor or here())


def _changes(before: AbstractUser, person: AbstractUser, fields: Collection[str]) -> list[dict[str, Any]]:
    """Return the changes among these fields: name, old value, new value. A password has no values."""
    changes: list[dict[str, Any]] = [
        {"field": name, "from": getattr(before, name), "to": getattr(person, name)}
        for name in SHOWN
        if name in fields and getattr(person, name) != getattr(before, name)
    ]
    if "password" in fields and _password_changed(before, person):
        changes.append({"field": "password"})
    return changes


def _password_changed(before: AbstractUser, person: AbstractUser) -> bool:
    """Return whether the password changed. A new hash is not enough: at sign-in Django may renew it."""
    if person.password == before.password:
        return False
    typed = person._password is not None  # type: ignore[attr-defined]  # set from `set_password` until `save`
    return typed or not person.has_usable_password() or not before.has_usable_password()


def _record(kind: str, person: RecordedUser, changes: list[dict[str, Any]]) -> None:
    body = _body(person, changes)
    record(
        kind,
        actor=person.changed_by or here(),
        parameters=body.parameters,
        private=body.private,
    )


def _body(person: RecordedUser, changes: list[dict[str, Any]]) -> RecordBody:
    """Return a change for the log.

    Field names and values of rights stay in the record; other values expire.
    """
    kept = [change if change["field"] in RIGHTS else {"field": change["field"]} for change in changes]
    change_parameters: dict[str, Any] = {"changes": kept} if changes else {}
    whole: dict[str, Any] = {"changes": changes} if kept != changes else {}
    return RecordBody({"user": str(person.pk), **change_parameters}, private={"name": str(person), **whole})
