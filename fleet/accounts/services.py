"""What happens to sign-ins."""

from __future__ import annotations

from datetime import timedelta
from uuid import UUID

from django.contrib.auth import HASH_SESSION_KEY
from django.contrib.sessions.models import Session
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone

from fleet.accounts.models import SignIn, User
from fleet.accounts.selectors import sign_ins_of

SEEN_EVERY = timedelta(minutes=1)


def sign_in_begun(request: HttpRequest, user: User) -> SignIn:
    """List the session of this request among the person's sign-ins."""
    if request.session.session_key is None:
        request.session.save()
    sign_in, _ = SignIn.objects.update_or_create(
        session_id=request.session.session_key,
        defaults={
            "user": user,
            "auth_hash": request.session[HASH_SESSION_KEY],
            "seen_at": timezone.now(),
            "address": address_of(request),
            "user_agent": request.headers.get("User-Agent", "")[:300],
        },
    )
    return sign_in


def sign_in_seen(request: HttpRequest) -> None:
    """Note that the session of this request was used, at most once a minute; its expiry moves along."""
    user = request.user
    if not isinstance(user, User):
        return
    seen_at = (
        SignIn.objects.filter(session_id=request.session.session_key)
        .values_list("seen_at", flat=True)
        .first()
    )
    if seen_at is None:  # Django gave the session a new key: the person changed their password here
        sign_in_begun(request, user)
    elif timezone.now() - seen_at > SEEN_EVERY:
        SignIn.objects.filter(session_id=request.session.session_key).update(seen_at=timezone.now())
        request.session.modified = True


def sign_in_end(*, user: User, sign_in_id: UUID) -> bool:
    """End one of the person's sign-ins, and with it what it holds open. False if there is no such."""
    return _end(sign_ins_of(user.pk).filter(pk=sign_in_id)) == 1


def sign_ins_end_others(*, user: User, session_key: str) -> int:
    """End all of the person's sign-ins but this one; how many there were."""
    return _end(sign_ins_of(user.pk).exclude(session_id=session_key))


def _end(sign_ins: QuerySet[SignIn]) -> int:
    keys = list(sign_ins.values_list("session_id", flat=True))
    _, deleted = Session.objects.filter(pk__in=keys).delete()
    return deleted.get("sessions.Session", 0)


def address_of(request: HttpRequest) -> str:
    """Where a request comes from; blank when the server listens on a Unix socket."""
    return str(request.META.get("REMOTE_ADDR") or "")
