"""The authentication backend: Django's passwords, the person of a session, permissions in the admin."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from django.contrib.auth.backends import ModelBackend
from django.contrib.auth.models import AbstractBaseUser, AnonymousUser

from fleet.accounts.models import User
from fleet.base.database import rows


class StaffBackend(ModelBackend):
    """Authenticates all people. Staff may do everything that the admin offers; permissions by model are not used.

    Sessions in the database name this class: another name would sign everybody out.
    """

    def get_user(self, user_id: UUID) -> User | None:
        """Return the account, if it may sign in.

        The query is hand-written for speed: it runs for every page.
        """
        found = rows.models(User, "SELECT * FROM accounts_user WHERE id = %s", [user_id])
        return next(filter(self.user_can_authenticate, found), None)

    def user_can_authenticate(self, user: Any) -> bool:
        """Return whether the account is open and belongs to a person: service accounts have no sessions."""
        return super().user_can_authenticate(user) and not (user and user.project)

    def has_perm(self, user_obj: Any, perm: str, obj: Any = None) -> bool:
        """Return whether the person is active staff; Django's permissions are not used."""
        return _is_staff(user_obj)

    def has_module_perms(self, user_obj: AbstractBaseUser | AnonymousUser, app_label: str) -> bool:
        """Return whether the person is active staff; the answer is the same for all apps."""
        return _is_staff(user_obj)


def _is_staff(user: AbstractBaseUser | AnonymousUser) -> bool:
    return user.is_active and getattr(user, "is_staff", False)
