"""Send what is queued for devices. Several processes may send: a process claims a delivery before it sends it."""

from __future__ import annotations

import json
import logging
from collections.abc import Collection
from datetime import datetime, timedelta
from uuid import UUID

from django.utils import timezone

from fleet.bookings.models import Notification
from robots.shared.wire import NotDone
from teleop.models import PushDelivery, PushSubscription
from teleop.push.encryption import encrypted_push
from teleop.push.keys import from_b64, signature_for
from teleop.push.services import address, device_remove
from teleop.webhooks.addresses import UNKNOWN_HOST, AddressRefused
from teleop.webhooks.post import post

log = logging.getLogger(__name__)

PAUSES = [timedelta(seconds=5), timedelta(seconds=30), timedelta(minutes=5), timedelta(hours=1)]
CLAIMED = timedelta(minutes=1)  # longer than an attempt takes
LONGEST = timedelta(days=1)  # a push service keeps a push so long for a device that is off
GONE = (404, 410)  # the browser or its person ended it
AGAIN = (408, 425, 429)  # and every status from 500 on: the service is busy
MOST_FAILURES = 10
TEXT_LENGTH = 600  # characters


def people_due(now: datetime) -> Collection[UUID]:
    """Return the people to whose devices something must be sent now."""
    due = PushDelivery.objects.filter(due_at__lte=now)
    return list(due.values_list("subscription__person", flat=True).distinct())


def send_due(person_id: UUID) -> int:
    """Send what is due to the devices of one person. Return how many deliveries were tried."""
    due = PushDelivery.objects.filter(subscription__person=person_id, due_at__lte=timezone.now())
    tried = 0
    for delivery in due.select_related("subscription__person", "notification").order_by("due_at", "pk"):
        now = timezone.now()
        mine = PushDelivery.objects.filter(pk=delivery.pk, due_at=delivery.due_at)
        if mine.update(due_at=now + CLAIMED):
            _deliver(delivery, now)
            tried += 1
    return tried


def _deliver(delivery: PushDelivery, now: datetime) -> None:
    device, notification = delivery.subscription, delivery.notification
    left = (notification.until or notification.made_at + LONGEST) - now
    if left <= timedelta(0) or notification.seen_at is not None or not device.person.is_active:
        delivery.delete()
        return
    try:
        status = _send(device, notification, left)
    except NotDone as failed:
        if isinstance(failed, AddressRefused) and failed.refusal.code != UNKNOWN_HOST:
            log.warning("A device is removed: %s", failed.refusal.text)
            device_remove(device, actor=None, why="bad_push_service")
            return
        log.info("A push is tried again: %s", failed.refusal.text)
        status = 503
    if 200 <= status < 300:
        PushSubscription.objects.filter(pk=device.pk).update(failures=0)
        delivery.delete()
    elif status in GONE:
        device_remove(device, actor=None, why="gone")
    elif (status in AGAIN or status >= 500) and delivery.tries < len(PAUSES):
        due_at = now + PAUSES[delivery.tries]
        PushDelivery.objects.filter(pk=delivery.pk).update(due_at=due_at, tries=delivery.tries + 1)
    else:
        _give_up(delivery, status)


def _send(device: PushSubscription, notification: Notification, left: timedelta) -> int:
    """Send a notification to a device, and return the push service's status. Raises `NotDone`."""
    target = address(device.endpoint)
    said = {
        "title": notification.subject,
        "body": notification.text[:TEXT_LENGTH],
        "path": notification.path or "/bookings/mine/",
        "tag": str(notification.pk),
    }
    text = json.dumps(said, ensure_ascii=False).encode()
    headers = {
        "Authorization": signature_for(f"{'https' if target.tls else 'http'}://{target.host_header}"),
        "Content-Type": "application/octet-stream",
        "Content-Encoding": "aes128gcm",
        "TTL": str(int(left.total_seconds())),
        "Urgency": "normal" if notification.until is None else "high",
        "User-Agent": "fleet-console",
        "Connection": "close",
    }
    return post(target, headers, encrypted_push(text, from_b64(device.p256dh), from_b64(device.auth))).status


def _give_up(delivery: PushDelivery, status: int) -> None:
    """End a delivery. A device to which nothing arrives any more is removed."""
    device = delivery.subscription
    log.warning("A push is given up: %s answered %s.", device.pk, status)
    delivery.delete()
    if device.failures + 1 >= MOST_FAILURES:
        device_remove(device, actor=None, why="silent")
    else:
        PushSubscription.objects.filter(pk=device.pk).update(failures=device.failures + 1)
