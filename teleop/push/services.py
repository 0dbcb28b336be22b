"""All changes of devices that get notifications, and the queue of what is sent to them. Changes are recorded."""

from __future__ import annotations

import hashlib
from datetime import datetime
from typing import Any
from urllib.parse import urlsplit

from cryptography.hazmat.primitives.asymmetric import ec
from django.conf import settings
from django.contrib.auth.signals import user_logged_out
from django.db import transaction
from django.dispatch import receiver
from django.http import HttpRequest
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.accounts.services import erased
from fleet.audit.services import record
from fleet.bookings.messages.notifications import notification_written
from fleet.bookings.models import Notification
from robots.shared.wire import NotDone, Refusal
from teleop.models import PushDelivery, PushSubscription
from teleop.push.keys import from_b64
from teleop.webhooks.addresses import AddressRefused, Target, target_of

MOST = 10  # devices of one person
IN_SESSION = "push_device"  # the device that a sign-in added: signing out removes it


class PushRefused(NotDone):
    """A device cannot get notifications."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(Refusal(code, text, "account"))


def address(endpoint: str) -> Target:
    """Return where a push goes: only by https to a public address, unless `FLEET_PUSH_ALLOW` has the host.

    Raises `AddressRefused`. The address that the name leads to is checked again with each push.
    """
    return target_of(endpoint, settings.FLEET_PUSH_ALLOW)


def device_add(
    *, person: User, endpoint: str, p256dh: str, auth: str, user_agent: str, now: datetime
) -> PushSubscription:
    """Send a person's notifications to a browser from now on. Raises `PushRefused`."""
    try:
        address(endpoint)
        ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), from_b64(p256dh))
        if len(from_b64(auth)) != 16:
            raise ValueError("The secret of a browser has 16 bytes.")
    except (AddressRefused, ValueError) as error:
        text = _(
            "The push service of this browser has no public https address, or its keys are wrong: use another."
        )
        raise PushRefused("bad_push_service", text) from error
    digest = hashlib.sha256(endpoint.encode()).hexdigest()
    facts = {"endpoint": endpoint, "p256dh": p256dh, "auth": auth, "user_agent": user_agent[:300]}
    with transaction.atomic():
        User.objects.select_for_update().get(
            pk=person.pk
        )  # so that two requests cannot both be the last allowed
        known = PushSubscription.objects.select_related("person").filter(digest=digest).first()
        if known is not None and known.person_id == person.pk:
            PushSubscription.objects.filter(pk=known.pk).update(**facts, failures=0)
            return known
        if PushSubscription.objects.filter(person=person).count() >= MOST:
            text = _("%(most)d devices of yours get notifications: remove one first.") % {"most": MOST}
            raise PushRefused("too_many_devices", text)
        if known is not None:  # somebody else used this browser
            device_remove(known, actor=person)
        made = PushSubscription.objects.create(person=person, digest=digest, made_at=now, **facts)
        _record("push.add", made, person)
    return made


def device_remove(subscription: PushSubscription, *, actor: User | None, why: str = "") -> None:
    """Send nothing to a device any more. `actor` None: the console itself."""
    with transaction.atomic():
        deleted, _rows = PushSubscription.objects.filter(pk=subscription.pk).delete()
        if deleted:
            _record("push.remove", subscription, actor, **({"why": why} if why else {}))


def _record(kind: str, subscription: PushSubscription, actor: User | None, **facts: Any) -> None:
    # Only the host of the address is recorded: who knows the rest could send requests to the push service.
    private = {"device": subscription.device, "host": urlsplit(subscription.endpoint).hostname}
    parameters = {"device": subscription.pk, "person": str(subscription.person_id), **facts}
    record(kind, actor=actor, parameters=parameters, private=private)


@receiver(notification_written)
def _queue(*, notification: Notification, **_options: Any) -> None:
    """Queue a notification for its person's devices, in the transaction that stores it."""
    PushDelivery.objects.bulk_create(
        PushDelivery(subscription=one, notification=notification, due_at=notification.made_at)
        for one in PushSubscription.objects.filter(person=notification.person_id)
    )


@receiver(erased)
def _forget(*, user: User, **_options: Any) -> None:
    """Forget an erased person's devices."""
    PushSubscription.objects.filter(person=user).delete()


@receiver(user_logged_out)
def _signed_out(*, request: HttpRequest | None, user: User | None, **_options: Any) -> None:
    """A person who signs out on a browser gets no more notifications there: somebody else may use it next."""
    session = getattr(request, "session", None)
    if user is None or session is None or (device := session.get(IN_SESSION)) is None:
        return
    if (found := PushSubscription.objects.filter(pk=device, person=user).first()) is not None:
        device_remove(found, actor=user)
