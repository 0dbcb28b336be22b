"""The page of the devices that get a person's notifications."""

from __future__ import annotations

import json

from django.contrib import messages
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from fleet.accounts.requests import person_of
from teleop.models import PushSubscription
from teleop.push import services
from teleop.push.keys import public_key

MOST_BYTES = 4096


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def devices(request: HttpRequest) -> HttpResponse:
    """List a person's devices; remove one."""
    own = PushSubscription.objects.filter(person=person_of(request))
    if request.method == "POST":
        number = request.POST.get("remove", "")
        device = get_object_or_404(own, pk=int(number) if number.isascii() and number.isdigit() else 0)
        services.device_remove(device, actor=person_of(request))
        messages.success(request, _("This device gets no more notifications."))
        return redirect("push-devices")
    return render(request, "teleop/push/devices.html", {"devices": own, "key": public_key()})


@require_POST
def device_add(request: HttpRequest) -> HttpResponse:
    """Add the browser that sends its subscription (JSON): 201, or 400 with the reason."""
    try:
        if len(request.body) > MOST_BYTES:
            raise ValueError("A subscription is shorter.")
        sent = json.loads(request.body)
        keys = {name: str(sent["keys"][name])[:100] for name in ("p256dh", "auth")}
        device = services.device_add(
            person=person_of(request),
            endpoint=str(sent["endpoint"]),
            **keys,
            user_agent=request.headers.get("User-Agent", ""),
            now=timezone.now(),
        )
    except (ValueError, KeyError, TypeError):
        text = _("The browser sent no subscription: load the page again, then press the button again.")
        return JsonResponse({"code": "bad_json", "detail": text}, status=400)
    except services.PushRefused as refused:
        return JsonResponse({"code": refused.refusal.code, "detail": refused.refusal.text}, status=400)
    request.session[services.IN_SESSION] = device.pk
    messages.success(request, _("This device gets your notifications now."))
    return JsonResponse({"device": device.pk}, status=201)
