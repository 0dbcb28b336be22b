"""The pages of webhooks, for staff: the list, a new webhook, and one webhook with its log and actions."""

from __future__ import annotations

from typing import Any
from uuid import UUID

from django.contrib import messages
from django.core.exceptions import BadRequest
from django.db.models import Count, Max, Q
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.dateparse import parse_datetime
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import staff_of
from fleet.audit.reading import wording
from fleet.base.zones import viewers
from robots.shared.wire import NotDone
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks import services
from teleop.webhooks.events import EVENT_CATEGORIES, TEST
from teleop.webhooks.forms import WebhookForm

SHOWN = 100  # deliveries

State = WebhookDelivery.State
_STAFF_ONLY = "Webhooks are for staff."


@never_cache
@require_safe
def webhooks(request: HttpRequest) -> HttpResponse:
    """List all webhooks with the counts of their deliveries."""
    staff_of(request, _STAFF_ONLY)
    found = Webhook.objects.select_related("owner").annotate(
        waiting=Count("deliveries", filter=Q(deliveries__state=State.WAITING)),
        given_up=Count("deliveries", filter=Q(deliveries__state=State.GIVEN_UP)),
        newest=Max("deliveries__made_at", filter=Q(deliveries__state=State.DELIVERED)),
    )
    return render(request, "teleop/webhooks/webhooks.html", {"webhooks": found, "zone": viewers().key})


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def webhook_new(request: HttpRequest) -> HttpResponse:
    """Make a webhook, and show its secret once."""
    staff = staff_of(request, _STAFF_ONLY)
    form = WebhookForm(request.POST or None)
    if request.method == "POST" and form.is_valid():
        try:
            webhook, secret = services.webhook_make(**form.cleaned_data, actor=staff)
        except NotDone as refused:
            form.add_error(None, refused.refusal.text)
        else:
            return render(
                request, "teleop/webhooks/webhook_secret.html", {"webhook": webhook, "secret": secret}
            )
    return render(
        request, "teleop/webhooks/webhook_new.html", {"form": form}, status=400 if form.errors else 200
    )


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def webhook(request: HttpRequest, webhook_id: UUID) -> HttpResponse:
    """Show the deliveries of a webhook with their answers; test, pause, resume and delete it."""
    staff = staff_of(request, _STAFF_ONLY)
    found = get_object_or_404(Webhook.objects.select_related("owner"), pk=webhook_id)
    if request.method == "POST":
        try:
            messages.success(request, _done(request.POST.get("action", ""), found, staff))
        except NotDone as refused:
            messages.error(request, refused.refusal.text)
        return redirect("webhook", found.pk) if found.pk else redirect("webhooks")
    deliveries = found.deliveries.order_by("-pk")[:SHOWN]
    context = {
        "webhook": found,
        "kinds": [EVENT_CATEGORIES[name].label for name in found.kinds if name in EVENT_CATEGORIES],
        "robots": found.robots.all(),
        "deliveries": [_line(one) for one in deliveries],
        "given_up": found.deliveries.filter(state=State.GIVEN_UP).count(),
        "shown": SHOWN,
        "zone": viewers().key,
    }
    return render(request, "teleop/webhooks/webhook.html", context)


def _done(action: str, webhook: Webhook, staff: User) -> str:
    """Carry out the action of a button. Return the sentence to show."""
    match action:
        case "test":
            services.webhook_test(webhook=webhook, actor=staff)
            return _("The test is on its way. Load this page again in some seconds.")
        case "pause":
            services.webhook_pause(webhook=webhook, actor=staff)
            return _("%s is paused.") % webhook
        case "resume":
            services.webhook_resume(webhook=webhook, actor=staff)
            return _("%s goes on.") % webhook
        case "again":
            number = services.webhook_again(webhook=webhook, actor=staff)
            return ngettext("%d delivery is tried again.", "%d deliveries are tried again.", number) % number
        case "delete":
            services.webhook_delete(webhook=webhook, actor=staff)
            return _("%s is deleted.") % webhook
    raise BadRequest("There is no such action.")


def _line(delivery: WebhookDelivery) -> dict[str, Any]:
    answers = [{**answer, "at": parse_datetime(answer["at"])} for answer in delivery.answers]
    label = _("test") if delivery.kind == TEST else wording.label(delivery.kind)
    return {"delivery": delivery, "label": label, "answers": answers}
