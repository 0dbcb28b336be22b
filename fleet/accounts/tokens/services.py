"""Make, find and end tokens. Each change is recorded."""

from __future__ import annotations

import secrets
from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from hashlib import sha256
from uuid import UUID, uuid4

from django.db import transaction
from django.db.models import QuerySet
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope, Token
from fleet.audit.command_line import SystemAccount
from fleet.audit.services import record
from fleet.base.database import rows
from fleet.base.names import require

LONGEST = timedelta(days=366)
PREFIX = "fleet_"  # so that a search finds tokens in files that must not contain any
MOST = 20  # valid tokens of one person
USED_EVERY = timedelta(minutes=1)
LISTED = timedelta(days=30)  # how long expired tokens stay in the list
KEY = "token:"  # a token's key starts with this; it is used in place of a session key


class TokenInvalid(Exception):
    """A text is not a valid token. `code` and `text` give the reason."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


class TooManyTokens(Exception):
    """A person has `MOST` valid tokens."""


class TokenExists(Exception):
    """A token with this id was made before."""


@transaction.atomic
def token_make(
    *,
    user: User,
    name: str,
    scopes: Collection[Scope],
    expires_at: datetime,
    actor: User | SystemAccount,
    robots: Sequence[UUID] = (),
    token_id: UUID | None = None,
    made_with: Token | None = None,
) -> tuple[Token, str]:
    """Make a token. Return it with its text, which is shown only once.

    `token_id`: the id of the new token. A form that is sent twice makes only one token: raises `TokenExists`.
    `made_with`: the token with which a program makes it. When that token ends, the new one ends, too. If that
    token has already ended: raises `TokenInvalid`. If the person has `MOST` valid tokens: raises
    `TooManyTokens`. If the name is refused: raises `ValidationError`.
    """
    require(name)
    User.objects.select_for_update(no_key=True).get(pk=user.pk)
    token_id = token_id or uuid4()
    if Token.objects.filter(pk=token_id).exists():
        raise TokenExists
    now = timezone.now()
    if Token.objects.filter(user=user, expires_at__gt=now).count() >= MOST:
        raise TooManyTokens
    if made_with and not Token.objects.select_for_update(no_key=True).filter(pk=made_with.pk).exists():
        raise TokenInvalid("token_invalid", "The token with which you asked has ended.")
    expires_at = min(expires_at, now + LONGEST)
    text = PREFIX + secrets.token_urlsafe(32)
    token = Token.objects.create(
        id=token_id,
        user=user,
        digest=digest_of(text),
        made_at=now,
        expires_at=expires_at,
        name=name,
        scopes=[scope.value for scope in Scope if scope in scopes],
        robots=[str(robot) for robot in robots],
        made_by=actor if isinstance(actor, User) else user,
        made_with=made_with,
    )
    facts = {
        "user": str(user.pk),
        "token": str(token.id),
        "scopes": token.scopes,
        "robots": token.robots,
        "expires": expires_at.isoformat(),
        **({"made_with": str(made_with.id)} if made_with else {}),
    }
    record("token.make", actor=actor, parameters=facts, private={"name": name})
    return token, text


@transaction.atomic
def token_end(*, token: Token, actor: User | SystemAccount) -> None:
    """End a token and the tokens that it made. Their streams and their control end within a second."""
    for child in Token.objects.filter(made_with=token.pk):
        token_end(token=child, actor=actor)
    if Token.objects.filter(pk=token.pk).delete()[0]:
        parameters = {"user": str(token.user_id), "token": str(token.id)}
        record("token.end", actor=actor, parameters=parameters, private={"name": token.name})


@transaction.atomic
def tokens_end(*, user: User, actor: User | SystemAccount) -> int:
    """End all tokens of a person. Return how many were valid."""
    now, valid = timezone.now(), 0
    for token in Token.objects.filter(user=user):
        valid += token.expires_at > now
        token_end(token=token, actor=actor)
    return valid


def tokens_of(user: User) -> QuerySet[Token]:
    """Return a person's tokens that are valid, or expired in the last 30 days."""
    return Token.objects.filter(user=user, expires_at__gt=timezone.now() - LISTED)


def remove_expired_tokens(now: datetime) -> None:
    """Remove tokens that are no longer listed."""
    Token.objects.filter(expires_at__lt=now - LISTED).delete()


def token_of(text: str, address: str = "") -> Token:
    """Return the token with this text, and note its use. Raises `TokenInvalid` if there is no valid token."""
    found = next(iter(_stored("digest = %s", [digest_of(text)])), None)
    if found is None:
        raise TokenInvalid(
            "token_invalid", "There is no such token: it was mistyped, or ended. Make another one."
        )
    now = timezone.now()
    if found.expires_at <= now:
        raise TokenInvalid("token_expired", f"The token “{found.name}” has expired. Make another one.")
    if not found.user.is_active:
        raise TokenInvalid("account_inactive", "This account is closed; ask the staff.")
    if is_use_due(found):
        token_used(found, address)
    return found


def is_use_due(token: Token) -> bool:
    """Return whether a use of the token must be noted: at most one a minute is."""
    return token.used_at is None or token.used_at < timezone.now() - USED_EVERY


def token_used(token: Token, address: str) -> None:
    """Note that a token was used from this address."""
    token.used_at = timezone.now()
    Token.objects.filter(pk=token.pk).update(used_at=token.used_at, used_from=address[:64])


def tokens_by_text(texts: Collection[str]) -> dict[str, Token]:
    """Return the tokens with these texts that are valid now. Two queries, or none. Their use is not noted."""
    by_digest = {digest_of(text): text for text in texts}
    if not by_digest:
        return {}
    found = _stored(f"digest IN ({rows.marks(by_digest)})", list(by_digest))
    return {by_digest[token.digest]: token for token in found if _is_valid(token)}


def valid_tokens(keys: Collection[str]) -> dict[str, Token]:
    """Return the tokens of these keys (`KEY` and the token's id) that are valid now. Two queries, or none."""
    ids = [key.removeprefix(KEY) for key in keys if key.startswith(KEY)]
    if not ids:
        return {}
    found = _stored(f"id IN ({rows.marks(ids)})", [UUID(one) for one in ids])
    return {f"{KEY}{token.id}": token for token in found if _is_valid(token)}


def _is_valid(token: Token) -> bool:
    return token.expires_at > timezone.now() and token.user.is_active


def _stored(which: str, values: Sequence[object]) -> list[Token]:
    """Return tokens with their people.

    The queries are hand-written for speed: each request of a program runs them.
    """
    tokens = f"FROM accounts_token WHERE {which}"
    found = rows.models(Token, f"SELECT * {tokens}", values)
    people = rows.models(User, f"SELECT * FROM accounts_user WHERE id IN (SELECT user_id {tokens})", values)  # noqa: S608
    by_id = {person.id: person for person in people}
    found = [token for token in found if token.user_id in by_id]  # without people who were deleted just now
    for token in found:
        token.user = by_id[token.user_id]
    return found


def key_of(token: Token) -> str:
    """Return a token's key, which is used where a browser has its session key."""
    return f"{KEY}{token.id}"


def digest_of(text: str) -> str:
    """Return what is stored of a secret."""
    return sha256(text.encode(errors="replace")).hexdigest()
