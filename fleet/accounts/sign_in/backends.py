"""Permissions in the admin."""

from __future__ import annotations

from typing import Any

from django.contrib.auth.backends import ModelBackend
from django.contrib.auth.models import AbstractBaseUser, AnonymousUser


class StaffBackend(ModelBackend):
    """Staff may administer everything that the admin offers; Django's permissions by model are not used."""

    def user_can_authenticate(self, user: Any) -> bool:
        """Return whether the account is open and a person's: service accounts have tokens and no session."""
        return super().user_can_authenticate(user) and not (user and user.project)

    def has_perm(self, user_obj: Any, perm: str, obj: Any = None) -> bool:
        """Return whether the person is active staff; permissions are not used."""
        return _is_staff(user_obj)

    def has_module_perms(self, user_obj: AbstractBaseUser | AnonymousUser, app_label: str) -> bool:
        """Return whether the person is active staff; apps do not differ."""
        return _is_staff(user_obj)


def _is_staff(user: AbstractBaseUser | AnonymousUser) -> bool:
    return user.is_active and getattr(user, "is_staff", False)
