"""Emergency stop by HTTP, for programs and for pages without a live connection.

A request by a person who may stop the robot must succeed even if the rest of the request is malformed. So
these views negotiate no content type. They read the body only to find a form's CSRF token, if no header
contains it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from http import HTTPStatus
from typing import Any

from django.contrib.auth.decorators import login_not_required
from django.core.exceptions import BadRequest, SuspiciousOperation
from django.http import Http404, HttpRequest, HttpResponse, JsonResponse, QueryDict, UnreadablePostError
from django.http.multipartparser import MultiPartParserError
from django.middleware.csrf import CsrfViewMiddleware
from django.shortcuts import render
from django.utils.datastructures import MultiValueDict
from django.utils.translation import gettext as _
from django.views.decorators.csrf import csrf_exempt

from fleet.accounts.models import User
from fleet.accounts.requests import person_of, wants_json
from fleet.accounts.services import address_of
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import TokenInvalid, token_of
from fleet.base.web.error_pages import error_page
from robots.access.selectors import robot_visible_to, robots_visible_to
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Refusal, Stopped
from teleop.records import refusals
from teleop.records.refusals import RefusedRequest
from teleop.stop import emergency_stop
from teleop.stop.presses import Pending, Result

SIGNED_OUT = Refusal("signed_out", "Not done: you are signed out. Sign in again.", "account")
_NO_ROBOT = Refusal("not_found", "There is no such robot, or you may not see it.", "wire")
_NOT_POST = Refusal("method_not_allowed", "Use POST to stop.", "wire")

OUTCOMES = "fleet.stop_outcomes"  # in the environment of a request whose stop `teleop.stop.door` has sent

View = Callable[..., HttpResponse]


class _CsrfCheck(CsrfViewMiddleware):
    """Django's own check of the origin and of the CSRF token.

    The token is in a header, or else in the body, if the body is readable.
    """

    def _reject(self, request: HttpRequest, reason: str) -> HttpResponse:
        if not (request.path.startswith("/api/") or wants_json(request)):
            page: HttpResponse = super()._reject(request, reason)  # type: ignore[misc]  # not in the stubs
            return page
        text = say(
            "Not stopped: the request is not from this console ({why}). "
            "Reload the page, or use the red button on the robot.",
            why=reason.rstrip("."),
        )
        return _refused(Refusal("permission_denied", text, "account"), 403)

    def check(self, request: HttpRequest) -> HttpResponse | None:
        """Return the refusal of a request that another site may have forged; None if the request passes the check."""
        try:
            from_header = "HTTP_X_CSRFTOKEN" in request.META
            if from_header:
                _leave_body_unread(request)
            else:
                request.POST  # noqa: B018 - this parses the body: it may fail here, but not later
        except (
            BadRequest,  # a form in another encoding than UTF-8
            MultiPartParserError,
            SuspiciousOperation,
            UnreadablePostError,
            ValueError,
            LookupError,
        ):
            _leave_body_unread(request)
        self.process_request(request)
        return self.process_view(request, _not_exempt, (), {})


def _not_exempt() -> HttpResponse:
    """Stand in for the checked view: Django's check reads here that the view is not exempt."""
    return HttpResponse()


def _leave_body_unread(request: HttpRequest) -> None:
    """Make Django treat the request as one without a form."""
    parts: dict[str, Any] = {"_post": QueryDict(), "_files": MultiValueDict()}
    request.__dict__.update(parts)


class _QuietCsrfCheck(_CsrfCheck):
    """The same check; its refusal has no words."""

    def _reject(self, request: HttpRequest, reason: str) -> HttpResponse:
        return HttpResponse(status=403)


_csrf = _CsrfCheck(lambda _request: HttpResponse())
_quiet_csrf = _QuietCsrfCheck(lambda _request: HttpResponse())


def may_be_forged(request: HttpRequest) -> bool:
    """Return whether another site may have made a signed-in browser send this request."""
    return _quiet_csrf.check(request) is not None


def _stop_view(view: View) -> View:
    """Wrap a view that stops robots with its only checks: the method, and a token or a session with CSRF."""

    def checked(request: HttpRequest, **parameters: Any) -> HttpResponse:
        if request.method != "POST":
            return _refused(_NOT_POST, 405, Allow="POST")
        token = _token(request)
        if token is not None:
            request.user, parameters["token"] = token.user, token
            return view(request, **parameters)
        if not isinstance(request.user, User):
            return _refused(SIGNED_OUT, 401)
        return _csrf.check(request) or view(request, **parameters)

    return csrf_exempt(checked)


def _token(request: HttpRequest) -> Token | None:
    """Return the token of a program without a session.

    A token of any scope may stop every robot that it may see.
    """
    if isinstance(request.user, User) or not request.path.startswith("/api/"):
        return None
    scheme, _space, text = request.headers.get("Authorization", "").partition(" ")
    try:
        return token_of(text.strip(), address_of(request)) if scheme.lower() == "bearer" else None
    except TokenInvalid:
        return None


@login_not_required
@_stop_view
def rest_stop(request: HttpRequest, slug: str, token: Token | None = None) -> HttpResponse:
    """Stop one robot, for a program. The answer is JSON, whatever the request accepts."""
    try:
        robot = robot_visible_to(person_of(request), slug)
        if token is not None and not token.serves(robot.id):
            raise Http404
    except Http404:
        refusals.record_soon(
            RefusedRequest(person_of(request), "rest", "POST robots/<slug:slug>/stop/", _NO_ROBOT)
        )
        return _refused(_NO_ROBOT, 404)
    return _by_rest(request, [robot])


@login_not_required
@_stop_view
def rest_stop_all(request: HttpRequest, token: Token | None = None) -> HttpResponse:
    """Stop every robot in service that this person may see, for a program."""
    robots = [robot for robot in _all_seen(request) if token is None or token.serves(robot.id)]
    return _by_rest(request, robots)


@_stop_view
def page_stop(request: HttpRequest, slug: str) -> HttpResponse:
    """Stop one robot, for a page's form."""
    return _by_page(request, [robot_visible_to(person_of(request), slug)])


@_stop_view
def page_stop_all(request: HttpRequest) -> HttpResponse:
    """Stop every robot in service that this person may see, for a page's form."""
    return _by_page(request, _all_seen(request))


def _all_seen(request: HttpRequest) -> list[Robot]:
    return list(robots_visible_to(person_of(request)).filter(enabled=True))


def _by_rest(request: HttpRequest, robots: Sequence[Robot]) -> HttpResponse:
    return rest_answer(_pressed(request, robots, "rest"))


def rest_answer(outcomes: emergency_stop.Outcomes) -> HttpResponse:
    """Return the answer for a program."""
    by_slug, status = emergency_stop.http_answer(outcomes)
    return JsonResponse({"robots": by_slug}, status=status, headers={"X-Content-Type-Options": "nosniff"})


def _pressed(request: HttpRequest, robots: Sequence[Robot], through: str) -> emergency_stop.Outcomes:
    """Stop robots, unless this request has stopped them already. Return the outcomes."""
    sent: emergency_stop.Outcomes | None = request.META.get(OUTCOMES)
    if sent is not None:
        return sent
    return emergency_stop.press_once(robots, user=person_of(request), through=through)


def _by_page(request: HttpRequest, robots: Sequence[Robot]) -> HttpResponse:
    """Answer with JSON or a page. The page writes nothing to the disk, so the answer works even on a full disk."""
    outcomes = _pressed(request, robots, "page")
    by_slug, status = emergency_stop.http_answer(outcomes)
    text = _text(outcomes)
    if wants_json(request):
        return JsonResponse({"text": text, "robots": by_slug}, status=status)
    return render(request, "teleop/stop/stopped.html", {"text": text, "robots": robots}, status=status)


def _text(outcomes: emergency_stop.Outcomes) -> str:
    texts = []
    if unreached := _names(outcomes, Refusal):
        texts.append(_("Not reached: %s. Use the red button on the robot.") % unreached)
    if pending := _names(outcomes, Pending):
        words = _(
            "Pending, not confirmed yet: %s. The stop will be delivered as soon as possible. "
            "Use the red button on the robot."
        )
        texts.append(words % pending)
    moving = [robot.name for robot, result in outcomes.items() if _moves(result)]
    if moving:
        words = _(
            "Moves although it is stopped: %s. The console cannot stop it: press the red button on the robot."
        )
        texts.append(words % ", ".join(moving))
    done = _("Stopped.") if outcomes else _("There is no robot in service that you may stop.")
    return " ".join(texts) or done


def _moves(result: Result) -> bool:
    return isinstance(result, Stopped) and result.moves_although_stopped is not None


def _names(outcomes: emergency_stop.Outcomes, kind: type) -> str:
    return ", ".join(robot.name for robot, result in outcomes.items() if isinstance(result, kind))


def _refused(refusal: Refusal, status: int, **headers: str) -> HttpResponse:
    """Return a problem document (RFC 9457), as the API does. Pages read its field `text`."""
    refused = {"figures": {}, **wire.to_builtins(refusal)}
    title = HTTPStatus(status).phrase
    problem = {
        "type": error_page(refusal.code),
        "title": title,
        "status": status,
        "detail": refusal.text,
        **refused,
    }
    kind = "application/problem+json"
    return JsonResponse({**problem, "refusals": [refused]}, status=status, content_type=kind, headers=headers)
