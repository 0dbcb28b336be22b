"""Begin and end sign-ins."""

from __future__ import annotations

from datetime import timedelta
from typing import Any
from uuid import UUID

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.contrib.auth import HASH_SESSION_KEY
from django.contrib.sessions.models import Session
from django.core.exceptions import ValidationError
from django.db import transaction
from django.db.models import QuerySet
from django.dispatch import Signal
from django.http import HttpRequest
from django.utils import timezone
from django.utils.text import slugify
from django.utils.translation import gettext as _

from fleet.accounts.models import ERASED, SignIn, User
from fleet.accounts.names import require_names
from fleet.accounts.selectors import sign_ins_of
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import tokens_end
from fleet.audit.command_line import SystemAccount
from fleet.audit.models import Record
from fleet.audit.person_erasure import erase, pseudonym
from fleet.audit.services import record
from fleet.base.names import RESERVED, require

FROM_THE_LIST = "ended from the session list"
NAMES = ("username", "full_name", "email")  # the fields of an account that identify the person
MOST_CHOICES = 200  # of one person about the control page: two for each robot, and few more
MOST_SIGN_INS = 50  # of one person; a newer one ends the oldest
SEEN_EVERY = timedelta(minutes=1)
_NOTED = "seen_at"  # key in the session's data: the time when its use was noted last, seconds since 1970

# Arguments: user, names (present and earlier ones). Sent when an account is erased, in the same transaction: other apps
# erase their data, too.
erased = Signal()


def sign_in_begun(request: HttpRequest, user: User) -> SignIn:
    """Add the session of this request to the person's sign-ins, and delete those that have expired."""
    Session.objects.filter(sign_in__user=user, expire_date__lt=timezone.now()).delete()
    if request.session.session_key is None:
        request.session.save()
    now = timezone.now()
    sign_in, _ = SignIn.objects.update_or_create(
        session_id=request.session.session_key,
        defaults={
            "user": user,
            "auth_hash": request.session[HASH_SESSION_KEY],
            "seen_at": now,
            "address": address_of(request),
            "user_agent": request.headers.get("User-Agent", "")[:300],
        },
    )
    request.session[_NOTED] = now.timestamp()
    _end(user, SignIn.objects.filter(pk__in=_oldest(user)), "too many sign-ins")
    return sign_in


def _oldest(user: User) -> list[UUID]:
    """Return the person's sign-ins beyond `MOST_SIGN_INS`, which were not used for the longest time."""
    used = SignIn.objects.filter(user=user).order_by("-seen_at", "-started_at")
    return list(used.values_list("pk", flat=True)[MOST_SIGN_INS:])


def sign_in_seen(request: HttpRequest) -> None:
    """Note that the session of this request was used, at most once a minute. This also extends the session.

    A session that was ended elsewhere while the request was under way stays ended.
    """
    key = request.session.session_key
    if key is None:  # a program, or nobody is signed in
        return
    now = timezone.now()
    # Every page reads the session's data anyway, so this check needs no query.
    if abs(now.timestamp() - request.session.get(_NOTED, 0.0)) <= SEEN_EVERY.total_seconds():
        return
    # Not if another request was faster: saving this request's copy of the session would undo its changes.
    if SignIn.objects.filter(session_id=key, seen_at__lt=now - SEEN_EVERY).update(seen_at=now):
        request.session[_NOTED] = now.timestamp()


def sign_in_end(*, user: User, sign_in_id: UUID) -> bool:
    """End one of the person's sign-ins and its open connections. False if there is no such sign-in."""
    return _end(user, sign_ins_of(user.pk).filter(pk=sign_in_id)) == 1


def sign_ins_end_others(*, user: User, session_key: str, why: str = FROM_THE_LIST) -> int:
    """End all of the person's sign-ins except this one. Return their number."""
    return _end(user, sign_ins_of(user.pk).exclude(session_id=session_key), why)


def own_password_changed(request: HttpRequest, user: User) -> None:
    """End all sign-ins of the person except that of this request, whose session has a new key from Django."""
    sign_in = sign_in_begun(request, user)
    sign_ins_end_others(user=user, session_key=sign_in.session_id, why="password changed")


@transaction.atomic
def password_reset(*, user: User, actor: User | SystemAccount, why: str, tokens: bool) -> int:
    """End every sign-in of the person and, with `tokens`, their tokens. Return how many tokens were valid."""
    sign_ins_end_others(user=user, session_key="", why=why)
    return tokens_end(user=user, actor=actor) if tokens else 0


@transaction.atomic
def _end(user: User, sign_ins: QuerySet[SignIn], why: str = FROM_THE_LIST) -> int:
    ending = list(sign_ins)
    Session.objects.filter(pk__in=[sign_in.session_id for sign_in in ending]).delete()
    for sign_in in ending:
        record(
            "account.sign_out",
            actor=user,
            outcome=why,
            private={"address": sign_in.address, "browser": sign_in.user_agent},
        )
    return len(ending)


def settings_choose(*, user: User, time_zone: str, language: str) -> None:
    """Set the person's time zone (blank: the lab's) and language (blank: the browser's). Recorded."""
    user.time_zone, user.language = time_zone, language
    user.changed_by = user
    user.save(update_fields=["time_zone", "language"])


@transaction.atomic
def page_choices_keep(*, user: User, kept: dict[str, Any]) -> None:
    """Store these choices of a person and keep the others.

    They are not recorded: they concern nobody else. Raises `ValidationError`: the account keeps too many.
    """
    account = User.objects.select_for_update(no_key=True).get(pk=user.pk)
    choices = {**account.page_choices, **kept}
    if len(choices) > MOST_CHOICES:
        raise ValidationError(_("Your account keeps the layouts of too many robots."))
    User.objects.filter(pk=user.pk).update(page_choices=choices)


def service_account_make(*, name: str, project: str, actor: User) -> User:
    """Make a service account of a project. It has no address and no password: programs use it with tokens.

    Raises `ValidationError`: a name is refused.
    """
    account = User(username=_free_username(name), full_name=name, project=project)
    require(project)
    require_names(account, None)
    account.set_unusable_password()
    account.changed_by = actor
    account.save()
    return account


def _free_username(name: str) -> str:
    """Return a user name similar to this name that no account has; case is ignored."""
    wanted = slugify(name)[:40] or "service"
    taken = {name.lower() for name in User.objects.values_list("username", flat=True)}
    names = (wanted, *(f"{wanted}-{number}" for number in range(2, len(taken) + 3)))
    return next(name for name in names if name not in taken | RESERVED)


def account_close(*, user: User) -> None:
    """Close an account for good, so that nothing more is recorded about its person.

    The changes are not recorded field by field: such records would contain data that must be erased.
    """
    _end(user, sign_ins_of(user.pk), "account erased")
    for table in (EmailAddress, Authenticator, SocialAccount, Token):
        table.objects.filter(user=user).delete()
    user.set_unusable_password()
    account = User.objects.filter(pk=user.pk)
    account.update(
        password=user.password, is_active=False, is_staff=False, is_superuser=False, page_choices={}
    )


def account_erase(*, user: User, actor: User | SystemAccount) -> Record:
    """Close an account and erase the person's names.

    After an interruption, repeat it with the old or new user name.
    """
    account_close(user=user)
    account = User.objects.filter(pk=user.pk)
    nobody = {"username": f"{ERASED}{user.pk}", "full_name": pseudonym(str(user.pk)), "email": ""}
    names = _names_of(user) - set(nobody.values())

    def forget() -> None:
        account.update(**nobody, is_active=False)  # staff may have opened it meanwhile
        erased.send(sender=User, user=user, names=names)

    return erase(
        str(user.pk),
        names=names,
        actor=actor,
        forget=forget,
    )


def _names_of(user: User) -> set[str]:
    """Return the person's current names, and earlier names that are still recorded."""
    names = {user.username, user.full_name, user.email}
    accounts = Record.objects.filter(kind__in=["account.create", "account.change"], content__isnull=False)
    for data in accounts.filter(parameters__user=str(user.pk)).values_list("content__data", flat=True):
        for change in data.get("changes", []):
            if change["field"] in NAMES:
                names |= {change.get("from", ""), change.get("to", "")}
    return names


def address_of(request: HttpRequest) -> str:
    """Return the address of a request; blank when the server listens on a Unix socket."""
    return str(request.META.get("REMOTE_ADDR") or "")
