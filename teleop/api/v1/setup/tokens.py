"""Tokens and service accounts. A token cannot make a token that may do more, or that is valid longer."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Annotated, Any, Literal
from uuid import UUID

from allauth.account.internal.flows.reauthentication import did_recently_reauthenticate
from django.db.models import Count, Max
from django.shortcuts import get_object_or_404
from django.utils import timezone
from msgspec import Meta, Struct
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.accounts.services import service_account_make
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import MOST, TokenInvalid, TooManyTokens, token_end, token_make, tokens_of
from fleet.base.names import require
from robots.access.selectors import robots_visible_to
from robots.registry.models import Robot
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import Entry, entry_of, operation, reads
from teleop.api.v1.framework.parameters import Moment, Time, utc
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import SetupView, makes, manages
from teleop.control.allowed.scopes import scope_missing

USUAL = timedelta(days=90)
ScopeName = Literal["read", "drive", "speak", "motions", "topics", "book", "manage"]  # of `Scope`
Name = Annotated[str, Meta(min_length=1, max_length=40)]
Word = Annotated[str, Meta(min_length=1, max_length=80)]

_BLANK = Refusal("invalid", "The name must not be blank.", "wire")
_NAME_TAKEN = Refusal("name_taken", "There is a token with this name: choose another one.", "account")
_TOO_MANY = Refusal(
    "too_many",
    say("There are {most} valid tokens: end one of them first.", most=MOST),
    "account",
    {"most": MOST},
)
_OVER = Refusal("invalid", "expires_at is in the past: choose a later time.", "wire")
_NOT_FRESH = Refusal(
    "password_needed",
    "A browser makes tokens only soon after its person gave the password: open /accounts/again/ first.",
    "account",
)


class TokenEntry(Struct, frozen=True):
    """A token; nothing shows its text again. `robots` null: all that its person may see."""

    id: UUID
    name: str
    scopes: list[ScopeName]
    robots: list[str] | None  # slugs of the robots that you may see
    made_at: Time
    expires_at: Time
    expired: bool
    used_at: Time | None
    used_from: str
    made_with: UUID | None  # the token that made it; when that token ends, this one ends, too
    current: bool  # the token of this request


class TokenList(Struct, frozen=True):
    """Tokens, by name; those that expired stay for 30 days."""

    tokens: list[TokenEntry]


class TokenMade(TokenEntry, frozen=True, kw_only=True):
    """A new token, with its text: shown once."""

    token: str


class TokenRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new token. A field that is left out is as in the token of the request; from a browser: all robots, 90 days."""

    name: Name
    scopes: Annotated[list[ScopeName], Meta(min_length=1, max_length=len(Scope))]
    robots: Annotated[list[str], Meta(min_length=1, max_length=1000)] | None = None  # slugs
    expires_at: Moment | None = None  # at most a year ahead


class ServiceAccount(Struct, frozen=True):
    """An account of a project, for programs with tokens only. Its roles are given like those of people."""

    id: UUID
    username: str
    name: str
    project: str
    active: bool
    tokens: int
    used_at: Time | None


class ServiceAccountList(Struct, frozen=True):
    """Service accounts, by project."""

    accounts: list[ServiceAccount]


class ServiceAccountRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new service account: its name as people see it when it drives, and its project."""

    name: Word
    project: Word


class TokensBase(SetupView):
    tag = "tokens"

    def concerned(self, *_path: Any, **asked: Any) -> Iterable[Robot]:
        """Return the robots of the token of the request: `_require_no_more` holds a new token to them."""
        new = isinstance(asked.get("body"), TokenRequest)
        return Robot.objects.filter(pk__in=self.token.robots) if self.token and new else ()

    def listed(self, owner: User) -> TokenList:
        """Return the tokens of a person."""
        return TokenList([self.entry(TokenEntry, token, owner) for token in tokens_of(owner)])

    def entry(self, kind: type[Entry], token: Token, owner: User, /, **others: str) -> Entry:
        """Return a token as it is shown to its owner."""
        slugs = {str(robot.pk): robot.slug for robot in robots_visible_to(owner)}
        return entry_of(
            kind,
            token,
            robots=[slugs[key] for key in token.robots if key in slugs] if token.robots else None,
            expired=token.expires_at <= timezone.now(),
            made_with=token.made_with_id,
            current=self.token is not None and token.pk == self.token.pk,
            **others,
        )

    def make(self, owner: User, body: TokenRequest) -> Response:
        """Make a token of `owner`. Raises `Problem`."""
        if self.token is None and not did_recently_reauthenticate(self.request._request):
            raise Problem(_NOT_FRESH)
        require(body.name)
        name = " ".join(body.name.split())
        if not name:
            raise Problem(_BLANK)
        if tokens_of(owner).filter(name=name).exists():
            raise Problem(_NAME_TAKEN)
        robots, expires_at = self._robots(owner, body), self._expiry(body)
        self._require_no_more(body, robots)
        try:
            made, text = token_make(
                user=owner,
                name=name,
                scopes=[Scope(scope) for scope in body.scopes],
                expires_at=expires_at,
                robots=[robot.pk for robot in robots],
                actor=self.person,
                made_with=self.token,
            )
        except TooManyTokens as error:
            raise Problem(_TOO_MANY) from error
        except TokenInvalid as error:
            raise Problem(Refusal(error.code, error.text, "account")) from error
        return self.shown_once(self.entry(TokenMade, made, owner, token=text))

    def _robots(self, owner: User, body: TokenRequest) -> list[Robot]:
        """Return the robots to which the new token is bound; an empty list: all robots. Raises `Problem`."""
        seen = list(robots_visible_to(owner))
        if body.robots is None:
            own = self.token.robots if self.token else []
            return [robot for robot in Robot.objects.all() if str(robot.pk) in own]
        found = {robot.slug: robot for robot in seen}
        if not set(body.robots) <= found.keys():
            raise Problem(NOT_FOUND)
        return [found[slug] for slug in dict.fromkeys(body.robots)]

    def _expiry(self, body: TokenRequest) -> datetime:
        if body.expires_at is not None:
            if body.expires_at <= timezone.now():
                raise Problem(_OVER)
            return utc(body.expires_at)
        return self.token.expires_at if self.token else timezone.now() + USUAL

    def _require_no_more(self, body: TokenRequest, robots: list[Robot]) -> None:
        """Raise `Problem` with all reasons, if the new token could do more than the token of this request."""
        own = self.token
        if own is None:
            return
        refusals = []
        if missing := [scope for scope in body.scopes if not own.opens(Scope(scope))]:
            refusals.append(_more("scopes", ", ".join(missing)))
        if not self.serves(robots):
            refusals.append(_more("robots", ", ".join(body.robots or ("all",))))
        if body.expires_at is not None and utc(body.expires_at) > own.expires_at:
            refusals.append(_more("expires_at", own.expires_at.isoformat()))
        if refusals:
            raise Problem(refusals[0], others=refusals)


class TokensView(TokensBase):
    @reads("tokens_list", "List your tokens", refuses=())
    def get(self) -> TokenList:
        """With their last use."""
        return self.listed(self.person)

    @makes(
        "tokens_make",
        "Make a token",
        answer=TokenMade,
        refuses=(404, 409),
        examples={"For a dashboard": {"name": "dashboard", "scopes": ["read"]}},
    )
    def post(self, body: TokenRequest) -> Response:
        """The new token may not do more or last longer than the token of the request, and ends with it. Only this
        answer shows its text; so this takes no Idempotency-Key, and the first of two requests takes the name."""
        return self.make(self.person, body)


class TokenView(TokensBase):
    def concerned(self, token_id: UUID, **_asked: Any) -> Iterable[Robot]:
        """Return the robots of the token that ends; a token may always end itself."""
        own = self.token
        ending = own if own and own.pk == token_id else Token.objects.filter(pk=token_id).first()
        return Robot.objects.filter(pk__in=ending.robots) if ending else ()

    @operation("tokens_end", "End a token", scope=None, status=204, refuses=(404,))
    def delete(self, token_id: UUID) -> None:
        """Ends its streams, its control and the tokens made with it, within a second. A token ends itself with any
        scope; others with `manage`: those of the same person, for staff everybody's; if bound, those for its robots."""
        own = self.token
        if own is not None and own.pk != token_id and not own.opens(Scope.MANAGE):
            raise Problem(scope_missing((Scope.MANAGE,)))
        found = Token.objects.select_related("user").filter(pk=token_id).first()
        if found is None or (found.user != self.person and not self.person.is_staff):
            raise Problem(NOT_FOUND)
        token_end(token=found, actor=self.person)


class ServiceAccountsView(TokensBase):
    @manages("service_accounts_list", "List service accounts", refuses=())
    def get(self) -> ServiceAccountList:
        """For staff."""
        self.staff()
        found = User.objects.exclude(project="").annotate(count=Count("tokens"), used=Max("tokens__used_at"))
        return ServiceAccountList([_account(one) for one in found.order_by("project", "full_name")])

    @makes("service_accounts_make", "Make a service account", keyed=True, refuses=())
    def post(self, body: ServiceAccountRequest) -> ServiceAccount:
        """For staff. It needs a role, and a token."""
        require(body.name)
        require(body.project)
        name, project = (" ".join(text.split()) for text in (body.name, body.project))
        if not (name and project):
            raise Problem(Refusal("invalid", "Name and project must not be blank.", "wire"))
        return _account(service_account_make(name=name, project=project, actor=self.staff()))


class ServiceTokensView(TokensBase):
    @manages("service_tokens_list", "List the tokens of a service account")
    def get(self, username: str) -> TokenList:
        """For staff."""
        return self.listed(self.account(username))

    @makes("service_tokens_make", "Make a token of a service account", answer=TokenMade, refuses=(404, 409))
    def post(self, username: str, body: TokenRequest) -> Response:
        """For staff, with the rules of `/tokens`. Nobody makes a token of another person."""
        return self.make(self.account(username), body)

    def account(self, username: str) -> User:
        """Return an open service account. Raises `Problem` or `Http404`."""
        self.staff()
        accounts = User.objects.exclude(project="").filter(is_active=True)
        return get_object_or_404(accounts, username=username.replace("\0", ""))


def _more(what: str, given: str) -> Refusal:
    text = say("The new token may not do more than your token: {what} ({given}).", what=what, given=given)
    return Refusal("more_than_own", text, "account", {"field": what})


def _account(one: User) -> ServiceAccount:
    return entry_of(
        ServiceAccount,
        one,
        name=one.full_name,
        active=one.is_active,
        tokens=getattr(one, "count", 0),
        used_at=getattr(one, "used", None),
    )
