"""The address at which another computer joins as a bridge host (`install-service bridges --join`)."""

from __future__ import annotations

import msgspec
from django.contrib.auth.decorators import login_not_required
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.csrf import csrf_exempt
from django.views.decorators.http import require_POST

from fleet.accounts.services import address_of
from fleet.accounts.sign_in import throttle
from robots.registry import bridge_hosts

NAME = "bridge host code"  # the name under which wrong codes are counted, like wrong passwords of a user name


class JoinRequest(msgspec.Struct, frozen=True):
    """The code of the command, and the request for a certificate (PEM)."""

    code: str
    certificate_request: str


@csrf_exempt  # a program of another computer; the code is its right
@login_not_required
@never_cache
@require_POST
def join(request: HttpRequest) -> HttpResponse:
    """Answer with settings and certificate, once for each code. Without a code, nothing else is told."""
    address = address_of(request)
    try:
        asked = msgspec.json.decode(request.body, type=JoinRequest)
        with throttle.attempt(username=NAME, address=address):
            try:
                joined = bridge_hosts.join(asked.code, asked.certificate_request, address)
            except bridge_hosts.NotJoined:
                throttle.failure_recorded(username=NAME, address=address)
                raise
    except bridge_hosts.NotNow as error:
        return _refused(str(error), 409)
    except throttle.TooMany as error:
        return _refused(throttle.words(error.wait_s), 429)
    except (bridge_hosts.NotJoined, msgspec.DecodeError):
        return _refused(
            _("This code is wrong, used or too old: make a new command under Add a bridge host."), 403
        )
    return JsonResponse(msgspec.to_builtins(joined))


def _refused(text: str, status: int) -> HttpResponse:
    return JsonResponse({"text": text}, status=status)
