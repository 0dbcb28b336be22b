"""One operation of the API: its scope, body and answer are said once, for the view and for the schema."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
from django.http import HttpResponseBase
from drf_spectacular.utils import OpenApiResponse, extend_schema
from msgspec import Struct
from rest_framework.authentication import SessionAuthentication
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import key_of
from robots.access.selectors import robots_visible_to
from robots.registry.models import Robot
from robots.wire import Refusal
from teleop.api.v1.door.authentication import TokenAuthentication
from teleop.api.v1.door.idempotency import KEY_PARAMETER, Caller, once
from teleop.api.v1.door.parameters import parameters_of, query_of
from teleop.api.v1.door.parsing import Unparsed
from teleop.api.v1.door.problems import (
    CONTENT_TYPE,
    NOT_FOUND,
    Problem,
    ProblemDetails,
    problem_of,
    response_of,
)
from teleop.api.v1.door.rates import TOO_OFTEN, asks_too_often
from teleop.control.scopes import scope_missing
from teleop.recording import refusals
from teleop.recording.refusals import RefusedRequest

MOST_BYTES = 64 * 1024
DEEPEST = 32  # levels of a body

View = TypeVar("View", bound=Callable[..., Any])


class ApiView(APIView):
    """Base of the views of version 1."""

    authentication_classes = [TokenAuthentication, SessionAuthentication]
    parser_classes = [Unparsed]
    login_required = False  # in Django's middleware; REST framework requires it

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> None:
        """Sign in, and refuse those who ask too often."""
        super().initial(request, *args, **kwargs)
        token = self.token
        if asks_too_often(key_of(token) if token else request.session.session_key or ""):
            raise Problem(TOO_OFTEN)

    def get_exception_handler(self) -> Callable[[Exception, dict[str, Any]], Response | None]:
        """Answer errors with problem details, and record refusals of people who are signed in."""
        return _refused

    @property
    def person(self) -> User:
        """The person of the request."""
        return person_of(self.request)

    @property
    def token(self) -> Token | None:
        """The token of the request; None: a browser's session."""
        return self.request.auth if isinstance(self.request.auth, Token) else None

    def accepted(self, entry: Struct, address: str) -> Response:
        """Answer 202: it goes on, and its status is at this address."""
        return Response(msgspec.to_builtins(entry), status=202, headers={"Location": address})

    def robots(self) -> list[Robot]:
        """Return the robots that the person may see, and the token serves."""
        token = self.token
        return [robot for robot in robots_visible_to(self.person) if token is None or token.serves(robot.id)]

    def robot(self, slug: str) -> Robot:
        """Return one of them. Raises `Problem`: not found."""
        found = robots_visible_to(self.person).filter(slug=slug).first()
        if found is None or (self.token is not None and not self.token.serves(found.id)):
            raise Problem(NOT_FOUND)
        return found


def operation(
    name: str,
    summary: str,
    *,
    scope: Scope | None,
    answer: type[Struct] | None = None,
    body: type[Struct] | None = None,
    query: type[Struct] | None = None,
    status: int = 200,
    refuses: tuple[int, ...] = (),
    content_type: str = "",
    problem: type[Struct] = ProblemDetails,
    keyed: bool = False,
    tag: str = "robots",
    **schema: Any,
) -> Callable[[View], View]:
    """Make a method of an `ApiView` an operation.

    `scope`: what a token needs (None: any token). `body`: its struct, decoded and passed as the argument `body`;
    `query`: that of the query parameters, passed as `query`. `answer`: the struct that the method returns (None: 204).
    `refuses`: further statuses of problems, `problem` their struct. `keyed`: it takes an Idempotency-Key.
    `content_type`: of an answer that is no JSON, or several with spaces between; the method returns a response.
    """

    def decorate(method: View) -> View:
        @functools.wraps(method)
        def call(view: ApiView, request: Request, *args: Any, **kwargs: Any) -> HttpResponseBase:
            _require_scope(view.token, scope)
            if body is not None:
                kwargs["body"] = decoded(request, body)
            if query is not None:
                kwargs["query"] = query_of(request, query)

            def work() -> HttpResponseBase:
                result = method(view, request, *args, **kwargs)
                if isinstance(result, HttpResponseBase):
                    return result
                return Response(None if answer is None else msgspec.to_builtins(result), status=status)

            if not keyed:
                return work()
            return once(request, Caller(view.person, view.token), work)

        problems = {*refuses, 401, 403, 429, 503}
        problems |= {400, 413} if body else {400} if query else set()
        problems |= {400, 409, 422} if keyed else set()
        parameters = [*schema.pop("parameters", []), *(parameters_of(query) if query else [])]
        parameters += [KEY_PARAMETER] if keyed else []
        responses: dict[Any, Any] = {
            (code, CONTENT_TYPE): OpenApiResponse(problem, "refused") for code in sorted(problems)
        }
        for kind in content_type.split():
            responses[status, kind] = OpenApiResponse(str, summary)
        if not content_type:
            responses[status] = OpenApiResponse(answer, summary)
        needs = f"Scope: `{scope.value}`." if scope else "Any token."
        documented = extend_schema(
            operation_id=name,
            summary=summary,
            description=f"{(method.__doc__ or '').strip()}\n\n{needs}".strip(),
            request=body,
            responses=responses,
            tags=[tag],
            parameters=parameters or None,
            **schema,
        )
        result: View = documented(call)  # type: ignore[assignment]
        return result

    return decorate


def decoded(request: Request, struct: type[Struct]) -> Any:
    """Return the body as a struct. Raises `Problem`: too large, no JSON, duplicate or unknown fields, wrong types."""
    raw = request.data if isinstance(request.data, bytes) else b""
    if len(raw) > MOST_BYTES:
        text = f"The body has {len(raw)} bytes; at most {MOST_BYTES} are taken."
        raise Problem(Refusal("too_large", text, "wire", {"bytes": len(raw), "limit_bytes": MOST_BYTES}))
    try:
        _require_plain(json.loads(raw.decode() or "{}", object_pairs_hook=_without_duplicates))
        return msgspec.json.decode(raw or b"{}", type=struct)
    except UnicodeDecodeError as error:
        raise Problem(Refusal("not_utf8", "The body is not UTF-8.", "wire")) from error
    except RecursionError as error:
        raise Problem(_TOO_DEEP) from error
    except msgspec.ValidationError as error:
        raise Problem(Refusal("invalid", f"The body does not fit: {error}", "wire")) from error
    except ValueError as error:
        raise Problem(Refusal("not_json", f"The body is not JSON: {error}", "wire")) from error


_TOO_DEEP = Refusal("too_deep", f"The body has more than {DEEPEST} levels.", "wire", {"limit": DEEPEST})

_HAS_NUL = Refusal("invalid", "The body has a text with the character NUL: leave it out.", "wire")


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise Problem(Refusal("duplicate_field", f"The body has the field “{twice[:100]}” twice.", "wire"))
    return found


def _require_plain(value: Any, level: int = 0) -> None:
    if level > DEEPEST:
        raise Problem(_TOO_DEEP)
    if isinstance(value, str) and "\0" in value:
        raise Problem(_HAS_NUL)
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _require_plain(inner, level + 1)


def _require_scope(token: Token | None, scope: Scope | None) -> None:
    if token is not None and scope is not None and not token.opens(scope):
        raise Problem(scope_missing((scope,)))


def _refused(error: Exception, context: dict[str, Any]) -> Response | None:
    problem = problem_of(error)
    request = context["request"]
    person = getattr(request, "_user", None)
    if problem is not None and isinstance(person, User):
        match = request.resolver_match
        asked = f"{request.method} {match.route if match else ''}".strip()
        refusals.record_soon(RefusedRequest(person, "rest", asked, problem.refusal))
    return response_of(error, context)
