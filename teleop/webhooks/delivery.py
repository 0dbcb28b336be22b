"""Send deliveries. Several processes may send: a process claims a delivery before it sends it.

A waiting delivery has the time of its next attempt. A process claims it by setting this time later, so that
another process tries again if the first one dies. Then an event may arrive twice, with the same identifier.
"""

from __future__ import annotations

import logging
import time
from datetime import datetime, timedelta
from typing import Any
from uuid import UUID

from cryptography.fernet import InvalidToken
from django.db.models import Q, QuerySet
from django.utils import timezone
from django.utils.translation import gettext as _

from fleet.accounts.sign_in.secrets import decrypted
from robots.shared.wire import NotDone
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks.addresses import target_of
from teleop.webhooks.events import body_of, event_id, rfc3339
from teleop.webhooks.post import post
from teleop.webhooks.signature import signature

log = logging.getLogger(__name__)

PAUSES = [
    timedelta(seconds=10),
    timedelta(minutes=1),
    timedelta(minutes=5),
    timedelta(minutes=30),
    timedelta(hours=2),
    timedelta(hours=12),
]
CLAIMED = timedelta(minutes=2)  # longer than an attempt takes, including the DNS lookup
BATCH_SIZE = 50  # of one webhook in one round
ANSWER_LENGTH = 300  # characters kept
KEPT = timedelta(days=30)
REMOVED_BATCH_SIZE = 500

State = WebhookDelivery.State


def active_webhooks() -> QuerySet[Webhook]:
    """Return the webhooks for which events are read and sent."""
    return Webhook.objects.filter(paused_at=None, owner__is_active=True, owner__is_staff=True)


def due(webhook_id: UUID, now: datetime) -> QuerySet[WebhookDelivery]:
    """Return the deliveries that must be sent now, oldest first."""
    waiting = WebhookDelivery.objects.filter(webhook=webhook_id, state=State.WAITING)
    # A due time later than the longest pause means that the clock was set back: send now.
    return waiting.filter(Q(due_at__lte=now) | Q(due_at__gt=now + PAUSES[-1])).order_by("due_at", "pk")


def send_due(webhook_id: UUID) -> int:
    """Send the due deliveries, until the receiver fails. Return how many deliveries were tried."""
    for tried in range(BATCH_SIZE):
        webhook = active_webhooks().select_related("owner").filter(pk=webhook_id).first()
        delivery = webhook and _claim_next(webhook.pk, timezone.now())
        if not webhook or not delivery:
            return tried
        answer = _attempt(webhook, delivery)
        _note(delivery, answer, timezone.now())
        if not answer["good"]:
            return tried + 1
    return BATCH_SIZE


def _claim_next(webhook_id: UUID, now: datetime) -> WebhookDelivery | None:
    for delivery in due(webhook_id, now)[:BATCH_SIZE]:
        mine = WebhookDelivery.objects.filter(pk=delivery.pk, state=State.WAITING, due_at=delivery.due_at)
        delivery.due_at = now + CLAIMED
        if mine.update(due_at=delivery.due_at):
            return delivery
    return None


def _attempt(webhook: Webhook, delivery: WebhookDelivery) -> dict[str, Any]:
    """Send a delivery. Return the entry for the log of deliveries."""
    begun_s = time.monotonic()
    kept: dict[str, Any] = {"at": rfc3339(timezone.now()), "status": None, "good": False}
    try:
        kept |= _send(webhook, delivery)
    except NotDone as refused:
        kept |= {"code": refused.refusal.code, "text": refused.refusal.text}
    except InvalidToken:
        text = _("The secret cannot be read: FLEET_SECRET_KEY changed. Make this webhook again.")
        kept |= {"code": "no_secret", "text": text}
    kept["text"] = kept["text"].replace("\x00", "")[:ANSWER_LENGTH]  # PostgreSQL stores no NUL
    kept["took_s"] = round(time.monotonic() - begun_s, 3)
    return kept


def _send(webhook: Webhook, delivery: WebhookDelivery) -> dict[str, Any]:
    body = body_of(delivery, webhook.texts)
    if body is None:
        return {"code": "expired", "text": _("The record of this event is no longer kept.")}
    target = target_of(webhook.address)
    event, timestamp = event_id(delivery), int(time.time())
    headers = {
        "Content-Type": "application/json; charset=utf-8",
        "User-Agent": "fleet-console",
        "Connection": "close",
        "Webhook-Id": event,
        "Webhook-Timestamp": str(timestamp),
        "Webhook-Signature": signature(decrypted(webhook.secret), event, timestamp, body),
    }
    answer = post(target, headers, body)
    redirected = 300 <= answer.status < 400
    text = _("Redirects are not followed.") + f" {answer.location}" if redirected else answer.text
    return {"status": answer.status, "good": answer.good, "text": text}


def _note(delivery: WebhookDelivery, answer: dict[str, Any], now: datetime) -> None:
    """Store the answer and the time of the next attempt, unless another process has claimed the delivery."""
    answers = [*delivery.answers, answer]
    state, due_at = State.WAITING, delivery.due_at
    if answer["good"]:
        state = State.DELIVERED
    elif len(answers) > len(PAUSES) or answer.get("code") == "expired":
        state = State.GIVEN_UP
        log.warning("A delivery to the webhook %s is given up.", delivery.webhook_id)
    else:
        due_at = now + PAUSES[len(answers) - 1]
    mine = WebhookDelivery.objects.filter(pk=delivery.pk, state=State.WAITING, due_at=delivery.due_at)
    mine.update(state=state, due_at=due_at, answers=answers)


def remove_old_deliveries(now: datetime) -> bool:
    """Remove some deliveries older than `KEPT`. Return whether there may be more."""
    old = WebhookDelivery.objects.filter(made_at__lt=now - KEPT).values_list("pk", flat=True)
    some = list(old[:REMOVED_BATCH_SIZE])
    WebhookDelivery.objects.filter(pk__in=some).delete()
    return len(some) == REMOVED_BATCH_SIZE
