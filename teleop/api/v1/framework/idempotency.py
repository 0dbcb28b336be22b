"""Idempotency-Key: a request that is sent again gets the same answer again, and its work is done only once.

A key belongs to a token, or to a browser's session. The first request claims the key before its work begins.
The same request, if it comes during the work, waits for that answer. If a claim never gets an answer, its
process ended during the work: nobody knows whether the work was done, so it is never repeated.
"""

from __future__ import annotations

import logging
import re
import threading
import time
from collections.abc import Callable
from datetime import datetime, timedelta
from hashlib import sha256
from typing import Any

from django.db import DatabaseError
from django.http import HttpResponseBase
from django.utils import timezone
from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.audit.errors import TooManyChanges
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import CONTENT_TYPE, Problem, body_of, problem_of
from teleop.models import KeyedRequest

log = logging.getLogger(__name__)

HEADER = "Idempotency-Key"
KEPT = timedelta(hours=24)
WAIT_S = 10.0
CHECK_S = 0.05
LONGEST_WORK_S = 60.0  # if a claim has no answer after this time, its process has ended
MOST_WAITING = 4  # further requests get the answer "in progress" at once
KEPT_HEADERS = ("Location", "ETag")
KEY_PARAMETER = OpenApiParameter(
    HEADER,
    {"type": "string", "minLength": 1, "maxLength": 100},
    OpenApiParameter.HEADER,
    description="Of your choice. The same request with the same key, within 24 h, is done once and answered again.",
)

MOST_KEYS = 2000  # of one person within `KEPT`
MOST_REFUSED = 100  # newest refusals that are kept of one person: a refused request did nothing

_waiting = threading.BoundedSemaphore(MOST_WAITING)
_NOT_KEPT = (401, 429)  # nothing was done: the same key may be used again
_ASKS = ("takes_time", "preview")  # nothing was done: the client sends it again with its answer
_MAY_BE_DONE = ("no_answer", "connection_lost", "not_recorded")  # the request had been sent to the robot
_WRONG_KEY = Refusal("invalid", say("{header} has 1 to 100 visible ASCII characters.", header=HEADER), "wire")
_REUSED = Refusal(
    "key_reused",
    say("Another request had this {header} within 24 h. Choose a new key for a new request.", header=HEADER),
    "wire",
)
_TOO_MANY = Refusal(
    "too_many_keys",
    say(
        "You have sent {most} requests with an {header} within 24 h, the most for one person. "
        "Send this one without it, or later.",
        most=MOST_KEYS,
        header=HEADER,
    ),
    "wire",
    {"most": MOST_KEYS},
)
_GOES_ON = Refusal(
    "in_progress",
    say("The first request with this {header} is not done yet. Ask again in a few seconds.", header=HEADER),
    "audit",
)
_UNKNOWN = Refusal(
    "outcome_unknown",
    say(
        "The first request with this {header} was interrupted: read whether it was done, then choose a new key.",
        header=HEADER,
    ),
    "audit",
)


def once(
    request: Request, person: User, sign_in: str, work: Callable[[], HttpResponseBase]
) -> HttpResponseBase:
    """Do `work` and keep its answer, or return the kept answer. Without a key: only do `work`.

    `sign_in`: the key of the request's token or session.
    """
    if (key := request.headers.get(HEADER)) is None:
        return work()
    if not re.fullmatch(r"[\x21-\x7e](?:[\x20-\x7e]{0,98}[\x21-\x7e])?", key):
        raise Problem(_WRONG_KEY)
    digest = _digest(sign_in, key)
    raw = request.data if isinstance(request.data, bytes) else b""
    asked = _digest(request.method or "", request.get_full_path(), sha256(raw).hexdigest())
    claim, mine = _claimed(digest, asked, person)
    if not mine:
        if claim.request != asked:
            raise Problem(_REUSED)
        return _kept(claim)
    return _worked(claim, work)


def remove_old_answers(now: datetime) -> None:
    """Delete the keys and answers of requests that are older than `KEPT`."""
    KeyedRequest.objects.filter(made_at__lt=now - KEPT).delete()


def _claimed(digest: str, asked: str, person: User) -> tuple[KeyedRequest, bool]:
    """Return the claim of a key, and whether this request made it."""
    now = timezone.now()
    facts = {"request": asked, "person": person, "made_at": now}
    kept = KeyedRequest.objects.filter(person=person)
    if kept.count() >= MOST_KEYS and not kept.filter(pk=digest).exists():
        raise Problem(_TOO_MANY, 429)
    claim, mine = KeyedRequest.objects.get_or_create(pk=digest, defaults=facts)
    if claim.made_at < now - KEPT:
        KeyedRequest.objects.filter(pk=digest, made_at=claim.made_at).delete()
        return KeyedRequest.objects.get_or_create(pk=digest, defaults=facts)
    return claim, mine


def _worked(claim: KeyedRequest, work: Callable[[], HttpResponseBase]) -> HttpResponseBase:
    try:
        response = work()
    except TooManyChanges:  # nothing was done: the same key may be used again
        claim.delete()
        raise
    except Exception as error:
        problem = problem_of(error)
        if problem is not None and problem.refusal.code in _ASKS:
            claim.delete()
        elif problem is not None and problem.refusal.code in _MAY_BE_DONE:
            _keep(claim, 409, body_of(Problem(_UNKNOWN, 409)), {})
        elif problem is not None:  # else it is a fault of the console: nobody knows what was done
            _keep(claim, problem.status, body_of(problem), {})
        raise
    if isinstance(response, Response):
        headers = {name: response[name] for name in KEPT_HEADERS if name in response}
        _keep(claim, response.status_code, response.data, headers)
    return response


def _keep(claim: KeyedRequest, status: int, body: Any, headers: dict[str, str]) -> None:
    try:
        if status >= 500 or status in _NOT_KEPT:
            claim.delete()
            return
        claim.status, claim.body, claim.headers = status, body, headers
        claim.save(update_fields=["status", "body", "headers"])
        if status >= 400:
            refused = KeyedRequest.objects.filter(person=claim.person_id, status__gte=400)
            older = refused.order_by("-made_at").values_list("pk", flat=True)[MOST_REFUSED:]
            KeyedRequest.objects.filter(pk__in=list(older)).delete()
    except DatabaseError as error:  # the work is done, so its answer is sent
        log.error("The answer of a request with a key is not kept: %s", error)


def _kept(claim: KeyedRequest) -> Response:
    """Wait for the answer of the first request, and return it. Raises `Problem`."""
    until_s = time.monotonic() + WAIT_S
    may_wait = _waiting.acquire(blocking=False)
    try:
        while claim.status is None:
            if (timezone.now() - claim.made_at).total_seconds() > LONGEST_WORK_S:
                raise Problem(_UNKNOWN, 409)
            if not may_wait or time.monotonic() > until_s:
                raise Problem(_GOES_ON, 409)
            time.sleep(CHECK_S)
            try:
                claim.refresh_from_db()
            except KeyedRequest.DoesNotExist as error:  # the first request did nothing
                raise Problem(_GOES_ON, 409) from error
    finally:
        if may_wait:
            _waiting.release()
    kind = CONTENT_TYPE if claim.status >= 400 else None
    return Response(
        claim.body, claim.status, headers={**claim.headers, "Idempotent-Replayed": "true"}, content_type=kind
    )


def _digest(*parts: str) -> str:
    return sha256("\0".join(parts).encode()).hexdigest()
