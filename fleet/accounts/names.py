"""Names of accounts: no door makes one that people mistake for another. Pages, the admin, lists and REST ask here."""

from __future__ import annotations

from typing import Any

from django.core.exceptions import ValidationError
from django.utils.translation import gettext_lazy as _

from fleet.accounts.changes import RecordedUser
from fleet.base.names import Fault, Looks, fault_of_person, fault_of_word, folded

ALIKE = Fault("name_alike", _("This name looks the same as that of another account: choose another one."))
TAKEN = Fault("name_taken", _("Another account has this user name: choose another one."))


class AccountNames:
    """The names of all accounts but one, to check new ones. Makes one query; for a list, make it once.

    `accounts`: the model `User`, which imports this module.
    """

    def __init__(self, accounts: Any, but: RecordedUser | None = None) -> None:
        self._accounts = accounts.objects.exclude(pk=but.pk if but else None)
        self._known = set[tuple[str, str]]()
        self._usernames = set[str]()
        self._looks = Looks()
        self.catch_up()

    def catch_up(self) -> None:
        """Add the names of accounts that were made or renamed since."""
        for pair in set(self._accounts.values_list("username", "full_name")) - self._known:
            self._known.add(pair)
            self.add(*pair)

    def fault_of_username(self, name: str) -> Fault | None:
        """Return why no account may have this user name."""
        if folded(name) in self._usernames:
            return TAKEN
        return fault_of_person(name) or fault_of_word(name) or (ALIKE if self._looks.alike(name) else None)

    def fault_of_name(self, name: str) -> Fault | None:
        """Return why no account may show this name. Two people may have the same name, in the same spelling."""
        return fault_of_person(name) or (ALIKE if self._looks.alike(name) else None)

    def add(self, username: str, full_name: str) -> None:
        """Add the names of a new account of the same list."""
        self._usernames.add(folded(username))
        for name in (username, full_name):
            self._looks.add(name)


def require_names(account: RecordedUser, before: RecordedUser | None) -> None:
    """Raise `ValidationError` by field if a new or changed name of an account is refused. Old names may stay."""
    names = AccountNames(type(account), but=account)
    errors = {}
    for field, fault_of in (("username", names.fault_of_username), ("full_name", names.fault_of_name)):
        name: str | None = getattr(account, field)  # None: the form has refused it already
        changed = before is None or getattr(before, field) != name
        if name and changed and (fault := fault_of(name)):
            errors[field] = ValidationError(str(fault.text), code=fault.code)
    if errors:
        raise ValidationError(errors)
