"""Questions about people and their sign-ins."""

from __future__ import annotations

from collections.abc import Collection
from uuid import UUID

from django.db.models import QuerySet
from django.utils import timezone
from django.utils.crypto import constant_time_compare

from fleet.accounts.models import SignIn, User
from fleet.accounts.tokens.services import valid_tokens


def signed_in(people: Collection[tuple[UUID, str]]) -> dict[tuple[UUID, str], User]:
    """People of those sign-ins (user, session key) that are still valid. One query for all, one more for tokens."""
    asked = set(people)
    tokens = valid_tokens([key for _user, key in asked])
    sign_ins = SignIn.objects.filter(
        session_id__in={key for _user, key in asked}, session__expire_date__gt=timezone.now()
    ).select_related("user")
    by_token = {(token.user.id, key): token.user for key, token in tokens.items()}
    return {person: user for person, user in by_token.items() if person in asked} | {
        person: sign_in.user
        for sign_in in sign_ins
        if (person := (sign_in.user.id, sign_in.session_id)) in asked
        and sign_in.user.is_active
        and constant_time_compare(sign_in.auth_hash, sign_in.user.get_session_auth_hash())
    }


def sign_ins_of(user_id: UUID) -> QuerySet[SignIn]:
    """A person's sign-ins that have not expired, newest use first."""
    return SignIn.objects.filter(user_id=user_id, session__expire_date__gt=timezone.now())


def username_of(typed: str) -> str:
    """Return the user name of the person who signs in by it or by their e-mail address; unknown: as typed.

    The address comes first: a user name that is another person's address must not lock that person out.
    """
    if "@" not in typed:
        return typed
    found = User.objects.filter(email=typed.strip().lower()).values_list("username", flat=True).first()
    return found or typed
