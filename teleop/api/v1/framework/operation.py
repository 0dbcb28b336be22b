"""One operation of the API: its scope, body and answer are declared once, for the view and for the schema."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial, wraps
from typing import Any, TypeVar, get_type_hints
from uuid import UUID

from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponseBase
from drf_spectacular.types import OpenApiTypes
from drf_spectacular.utils import OpenApiExample, OpenApiParameter, OpenApiResponse, extend_schema
from msgspec import Struct
from rest_framework.authentication import SessionAuthentication
from rest_framework.permissions import SAFE_METHODS
from rest_framework.request import Request
from rest_framework.response import Response
from rest_framework.views import APIView

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import key_of
from robots.access.selectors import robots_visible_to, role_on
from robots.registry.known_robots import KnownRobot, known_robot_at
from robots.registry.models import Robot, Role
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.api.v1.framework import losses
from teleop.api.v1.framework.authentication import TokenAuthentication
from teleop.api.v1.framework.idempotency import KEY_PARAMETER, once
from teleop.api.v1.framework.parameters import parameters_of, query_of, require_declared
from teleop.api.v1.framework.parsing import Nothing, Unparsed, decoded
from teleop.api.v1.framework.problems import (
    CONTENT_TYPE,
    NOT_FOUND,
    OF_THE_DOOR,
    Problem,
    ProblemDetails,
    problem_of,
    response_of,
)
from teleop.api.v1.framework.rates import TOO_OFTEN, asks_too_often, headers_of
from teleop.control.allowed.scopes import scope_missing
from teleop.records import refusals
from teleop.records.refusals import RefusedRequest

View = TypeVar("View", bound=Callable[..., Any])
Entry = TypeVar("Entry", bound=Struct)

OTHER_ROBOTS = Refusal(
    "other_robots", "This is about robots that the token does not serve: use another token.", "account"
)


class ApiView(APIView):
    """Base of the views of version 1."""

    authentication_classes = [TokenAuthentication, SessionAuthentication]
    parser_classes = [Unparsed]
    login_required = False  # in Django's middleware; REST framework requires it
    tag = "robots"  # of the operations in the schema

    def setup(self, request: HttpRequest, *args: Any, **kwargs: Any) -> None:
        """Store when the request came: it may wait before it is carried out."""
        super().setup(request, *args, **kwargs)
        self.came_s = time.monotonic()

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> None:
        """Sign the client in, and refuse clients that send too many requests."""
        super().initial(request, *args, **kwargs)
        if asks_too_often(self.sign_in):
            raise Problem(TOO_OFTEN)

    def finalize_response(self, request: Request, response: Any, *args: Any, **kwargs: Any) -> Any:
        """Add the headers with the rate that is left to a client who is signed in."""
        response = super().finalize_response(request, response, *args, **kwargs)
        if isinstance(getattr(request, "_user", None), User):
            for name, value in headers_of(self.sign_in).items():
                response[name] = value
        return response

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

    @property
    def sign_in(self) -> str:
        """The key of the request's token, or of its session."""
        return key_of(self.token) if self.token else self.request.session.session_key or ""

    seen_by: Callable[[User], QuerySet[Robot]] = staticmethod(robots_visible_to)

    def robots(self) -> list[Robot]:
        """Return the robots that the person may see, and the token serves."""
        return [robot for robot in self.seen_by(self.person) if self.token_serves(robot.id)]

    def token_serves(self, robot_id: UUID) -> bool:
        """Return whether the request's token may be used for the robot.

        A session may be used for all robots.
        """
        return self.token is None or self.token.serves(robot_id)

    def concerned(self, *_path: Any, **_asked: Any) -> Iterable[Robot]:
        """Return the robots that a change concerns, from its path, body and query.

        Before a change, a token that is bound to robots must serve them all, and there must be one: other robots may
        be added to the entry later. Views say it here; those that do not are closed to such tokens.
        """
        return ()

    def serves(self, robots: Iterable[Robot]) -> bool:
        """Return whether the token may be used for all these robots. One that is bound to robots needs at least one."""
        token = self.token
        if token is None or not token.robots:
            return True
        served = [token.serves(robot.id) for robot in robots]
        return bool(served) and all(served)

    def require_served(self, robots: Iterable[Robot]) -> None:
        """Raise `Problem` if the token does not serve all these robots."""
        if not self.serves(robots):
            raise Problem(OTHER_ROBOTS)

    def robot(self, slug: str) -> Robot:
        """Return one of these robots. Raises `Problem`: not found."""
        try:
            found = self.seen_by(self.person).get(slug=slug)
        except Robot.DoesNotExist:
            raise Problem(NOT_FOUND) from None
        if not self.token_serves(found.id):
            raise Problem(NOT_FOUND)
        return found

    def known_robot(self, slug: str) -> tuple[KnownRobot, Role]:
        """Return one of these robots, for reading only, and the person's role on it.

        Takes a third of the time of `robot`. Raises `Problem`: not found.
        """
        known = known_robot_at(slug)
        role = role_on(self.person, known.robot) if known else None
        if known is None or role is None or not self.token_serves(known.robot.id):
            raise Problem(NOT_FOUND)
        return known, role


@dataclass
class Operation:
    """A decorator that makes a method of an `ApiView` an operation: `@operation("stop_clear", "Clear the stop", ...)`.

    Similar operations share a `partial(operation, ...)`. The method's docstring is the description in the
    schema. The types of its arguments `body` and `query` say how these are decoded, and the type that it returns is
    that of the answer. If a method returns a response, for example with headers, then this response is sent. The
    request is `self.request`.
    """

    name: str
    summary: str
    _: KW_ONLY
    scope: Scope | tuple[Scope, ...] | None  # a token needs this scope, or one of these; None: any token
    answer: type[Struct] | None = None  # of a method that returns a response
    status: int | None = None  # of the answer; None: 200, or 204 without an answer
    content_type: str = ""  # of an answer that is not JSON; spaces separate several types
    refuses: tuple[int, ...] = ()  # further statuses of problems
    problem: type[Struct] = ProblemDetails  # the struct of problems
    keyed: bool = False  # the operation accepts an Idempotency-Key
    takes_time: bool = False  # from people: it is done only when the client confirms that (`losses`)
    parameters: Sequence[OpenApiParameter] = ()  # further parameters: of the path, headers
    examples: Mapping[str, Any] = field(default_factory=dict)  # bodies, by the examples' names
    body: type[Struct] | None = field(default=None, init=False)
    query: type[Struct] | None = field(default=None, init=False)

    def __call__(self, method: View) -> View:
        """Return the method with checks of scope, body and query before it, and with its schema."""
        self._read_types(method)
        if self.takes_time:
            self.problem, self.refuses = losses.LossesProblem, (*self.refuses, 409)
            self.parameters = (*self.parameters, *losses.PARAMETERS)

        @wraps(method)
        def call(view: ApiView, request: Request, *args: Any, **kwargs: Any) -> HttpResponseBase:
            self._require_scope(view.token)
            kwargs |= self._asked(request)
            if request.method not in SAFE_METHODS and view.token is not None and view.token.robots:
                view.require_served(view.concerned(**kwargs))

            def work() -> HttpResponseBase:
                return self._response(method(view, *args, **kwargs))

            if self.takes_time:
                work = partial(losses.weighed, request, view.person, work)
            return once(request, view.person, view.sign_in, work) if self.keyed else work()

        documented: View = self._schema(method)(call)
        return documented

    def _read_types(self, method: Callable[..., Any]) -> None:
        """Take the types of body, query and answer from the method's annotations."""
        types = get_type_hints(method)
        self.body, self.query = types.get("body"), types.get("query")
        if types["return"] is type(None):
            self.answer = None
        elif isinstance(types["return"], type) and issubclass(types["return"], Struct):
            self.answer = types["return"]

    @property
    def _scopes(self) -> tuple[Scope, ...]:
        return () if self.scope is None else self.scope if isinstance(self.scope, tuple) else (self.scope,)

    def _require_scope(self, token: Token | None) -> None:
        if token is not None and self._scopes and not any(map(token.opens, self._scopes)):
            raise Problem(scope_missing(self._scopes))

    def _asked(self, request: Request) -> dict[str, Any]:
        """Return body and query as the method's arguments. Unknown fields and parameters are refused."""
        asked = {}
        if self.body is not None:
            asked["body"] = decoded(request, self.body)
        elif request.method not in SAFE_METHODS:
            decoded(request, Nothing)
        if self.query is not None:
            asked["query"] = query_of(request, self.query)
        else:
            require_declared(
                request, {one.name for one in self.parameters if one.location == OpenApiParameter.QUERY}
            )
        return asked

    @property
    def _status(self) -> int:
        return self.status or (200 if self.answer or self.content_type else 204)

    def _response(self, result: Any) -> HttpResponseBase:
        if isinstance(result, HttpResponseBase):
            return result
        return Response(None if self.answer is None else wire.to_builtins(result), status=self._status)

    def _schema(self, method: Callable[..., Any]) -> Callable[..., Any]:
        """Return the decorator that adds the schema."""
        names = ", ".join(f"`{scope.value}`" for scope in self._scopes)
        one_of = "one of " if len(self._scopes) > 1 else ""
        needs = f"Scope: {one_of}{names}." if names else "Any token."
        parameters = [*self.parameters, *(parameters_of(self.query) if self.query else ())]
        changes = method.__name__.upper() not in SAFE_METHODS
        return extend_schema(
            operation_id=self.name,
            summary=self.summary,
            description=f"{(method.__doc__ or '').strip()}\n\n{needs}".strip(),
            request=self.body,
            responses=self._answers(changes=changes),
            parameters=[*parameters, *([KEY_PARAMETER] if self.keyed else ())] or None,
            examples=[OpenApiExample(name, body, request_only=True) for name, body in self.examples.items()],
        )

    def _answers(self, *, changes: bool) -> dict[Any, OpenApiResponse]:
        problems = {*self.refuses, *OF_THE_DOOR, 401, 403, 406, 429}
        problems |= {415} if changes else set()
        problems |= {400, 409, 415, 422} if self.keyed else set()
        answers: dict[Any, OpenApiResponse] = {
            (code, CONTENT_TYPE): OpenApiResponse(self.problem, "refused") for code in sorted(problems)
        }
        if self.content_type:
            kinds = self.content_type.split()
            return answers | {
                (self._status, kind): OpenApiResponse(
                    OpenApiTypes.BINARY if kind.startswith("image/") else str, self.summary
                )
                for kind in kinds
            }
        return answers | {self._status: OpenApiResponse(self.answer, self.summary)}


operation = Operation  # lower case, because it is used as a decorator
reads = partial(operation, scope=Scope.READ, refuses=(404,))  # the most usual kind; lists have no 404


def entry_of(kind: type[Entry], row: object, /, **others: Any) -> Entry:
    """Return an entry of an answer: `others`, and the remaining fields from the row's attributes of these names."""
    same = {name: getattr(row, name) for name in kind.__struct_fields__ if name not in others}
    return kind(**same, **others)


def _refused(error: Exception, context: dict[str, Any]) -> Response | None:
    problem = problem_of(error)
    request = context["request"]
    person = getattr(request, "_user", None)
    if problem is not None and isinstance(person, User):
        match = request.resolver_match
        asked = f"{request.method} {match.route if match else ''}".strip()
        refusals.record_soon(RefusedRequest(person, "rest", asked, problem.refusal))
    return response_of(error, context)
