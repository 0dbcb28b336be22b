"""Errors as problem details (RFC 9457), which contain the refusal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from django.core.exceptions import NON_FIELD_ERRORS, PermissionDenied, ValidationError
from django.http import Http404
from msgspec import UNSET, Struct, UnsetType
from rest_framework.exceptions import (
    APIException,
    AuthenticationFailed,
    MethodNotAllowed,
    NotAcceptable,
    NotAuthenticated,
    UnsupportedMediaType,
)
from rest_framework.response import Response
from rest_framework.views import set_rollback

from fleet.base.web.error_pages import error_page
from robots.shared import wire
from robots.shared.wire import NotDone, Refusal, Rule, Said

CONTENT_TYPE = "application/problem+json"
_BY_RULE: dict[str, int] = {"account": 403, "wire": 400, "audit": 503, "database": 503}
_OUT_OF_REACH = (
    "bridge_down",
    "bridge_silent",
    "other_robot",
    "no_programs",
    "not_connected",
    "connection_lost",
    "no_answer",
    "camera_silent",
    "recording_away",
    "recording_lost",
    "store_away",
)
_BY_CODE = {
    "signed_out": 401,
    "token_invalid": 401,
    "token_expired": 401,
    "account_inactive": 401,
    "not_found": 404,
    "changed": 412,
    "name_taken": 409,
    "too_many": 409,
    "paused": 409,
    "too_large": 413,
    "key_reused": 422,
    "if_match_missing": 428,
    "busy": 429,
    "flood": 429,
    "too_often": 429,
    **dict.fromkeys(_OUT_OF_REACH, 503),
}
_CONFLICT = 409
RETRY_S = 5

NOT_FOUND = Refusal("not_found", "There is nothing at this address, or you may not see it.", "wire")
SIGNED_OUT = Refusal(
    "signed_out", "Not done: send a token in the header Authorization (Bearer ...), or sign in.", "account"
)


OF_THE_DOOR = (
    400,
    408,
    413,
    414,
    431,
    503,
)  # with which `fleet.server` refuses any request, before it is read


class ProblemDetails(Struct, frozen=True):
    """Why a request was not carried out."""

    title: str  # the HTTP status in words
    status: int
    detail: str  # for people: one sentence, with what to do
    code: str  # for programs: stable
    rule: Rule  # the check that refused
    figures: Mapping[str, float | int | str | None]
    refusals: list[Refusal]  # all refusals, if several rules refuse
    type: str  # the address of the page about the code
    said: Said | UnsetType = UNSET  # key and figures of `detail`, for a page in another language


class Problem(Exception):
    """A request that is not carried out."""

    def __init__(
        self,
        refusal: Refusal,
        status: int | None = None,
        *,
        others: list[Refusal] | None = None,
        extensions: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal
        self.status = status or _BY_CODE.get(refusal.code) or _BY_RULE.get(refusal.rule, _CONFLICT)
        self.others = others or []
        self.extensions = extensions or {}  # further members of the problem details


def problem_of(error: Exception) -> Problem | None:
    """Return the problem of an error; None: the error is a fault of the console."""
    if isinstance(error, Problem):
        return error
    if isinstance(error, NotDone):
        return Problem(error.refusal, others=getattr(error, "refusals", None))
    if isinstance(error, ValidationError):
        return Problem(fault_refusal(error))
    if isinstance(error, Http404):
        return Problem(NOT_FOUND)
    if isinstance(error, PermissionDenied):
        return Problem(Refusal("permission_denied", str(error) or "You may not do this.", "account"))
    if isinstance(error, NotAuthenticated):
        return Problem(SIGNED_OUT)
    if isinstance(error, AuthenticationFailed):
        codes = error.get_codes()
        code = codes if isinstance(codes, str) else "signed_out"
        return Problem(Refusal(code, str(error.detail), "account"), 401)
    if isinstance(error, MethodNotAllowed):
        return Problem(Refusal("method_not_allowed", str(error.detail), "wire"), 405)
    if isinstance(error, NotAcceptable | UnsupportedMediaType):
        return Problem(Refusal(error.default_code, str(error.detail), "wire"), error.status_code)
    if isinstance(error, APIException):
        rule: Rule = "account" if error.status_code == 403 else "wire"
        return Problem(Refusal(error.default_code, str(error.detail), rule), error.status_code)
    return None


def fault_refusal(error: ValidationError) -> Refusal:
    """Return the faults that a model, a form or a service found as one refusal that names the fields."""
    fields = error.message_dict if hasattr(error, "error_dict") else {}
    texts = [
        " ".join(words) if name == NON_FIELD_ERRORS else f"{name}: {' '.join(words)}"
        for name, words in fields.items()
    ]
    single = error if hasattr(error, "error_list") else next(iter(error.error_dict.values()))[0]
    code = getattr(single, "code", None) or ""
    # Codes of Django, such as "unique", are no codes of the API.
    return Refusal(code if code.startswith("name_") else "invalid", " ".join(texts or error.messages), "wire")


def response_of(error: Exception, context: dict[str, Any]) -> Response | None:
    """Return the response to an error; None: a fault of the console. This is DRF's exception handler."""
    problem = problem_of(error)
    if problem is None:
        return None
    set_rollback()
    response = Response(body_of(problem), status=problem.status, content_type=CONTENT_TYPE)
    if problem.status == 401:
        response["WWW-Authenticate"] = 'Bearer realm="fleet"'
    if problem.status in (429, 503):
        response["Retry-After"] = str(RETRY_S)
    if problem.status == 405:
        response["Allow"] = ", ".join(context["view"].allowed_methods)
    return response


def body_of(problem: Problem) -> Any:
    """Return a problem's body."""
    refusal = problem.refusal
    details = ProblemDetails(
        title=_TITLES.get(problem.status, "Not done"),
        status=problem.status,
        detail=refusal.text,
        code=refusal.code,
        rule=refusal.rule,
        figures=refusal.figures,
        type=error_page(refusal.code),
        refusals=problem.others or [refusal],
        said={"detail": refusal.said["text"]} if refusal.said else UNSET,
    )
    return wire.to_builtins(details) | wire.to_builtins(problem.extensions)


_TITLES = {
    400: "The request is not valid",
    401: "Not signed in",
    403: "Not permitted",
    404: "Not found",
    405: "Method not allowed",
    406: "Not acceptable",
    409: "Refused",
    412: "Changed since you read it",
    413: "Too large",
    415: "Unsupported media type",
    422: "Another request had this key",
    428: "A condition is needed",
    429: "Too many requests",
    503: "Not possible now",
}
