"""All changes of webhooks. Each change writes an audit record."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any
from urllib.parse import urlsplit

from django.db import IntegrityError, transaction
from django.utils import timezone
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.accounts.sign_in.secrets import encrypted
from fleet.audit.services import record
from fleet.base.names import require
from robots.registry.models import Robot
from robots.shared.wire import NotDone, Refusal
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks.addresses import target_of
from teleop.webhooks.event_reader import newest_record
from teleop.webhooks.events import EVENT_CATEGORIES, TEST
from teleop.webhooks.signature import new_secret

MOST = 20  # each has a thread in every housekeeping process


class WebhookRefused(NotDone):
    """A change of a webhook is not allowed."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(Refusal(code, text, "account"))


def webhook_make(
    *,
    name: str,
    address: str,
    kinds: Collection[str],
    robots: Sequence[Robot] = (),
    texts: bool = False,
    actor: User,
) -> tuple[Webhook, str]:
    """Make a webhook for events from now on; no robots: all. Return it with its secret.

    The secret is shown only once. Raises `AddressRefused`, `WebhookRefused`, or `ValidationError` about the name.
    """
    _require_staff(actor)
    require(name)
    target_of(address)
    if not kinds or not set(kinds) <= EVENT_CATEGORIES.keys():
        raise WebhookRefused("no_kinds", _("Choose at least one category of events."))
    if Webhook.objects.count() >= MOST:
        raise WebhookRefused("too_many", _("There are %d webhooks. Delete one first.") % MOST)
    secret = new_secret()
    try:
        with transaction.atomic():
            webhook = Webhook.objects.create(
                name=name,
                address=address,
                secret=encrypted(secret),
                kinds=sorted(kinds),
                texts=texts,
                owner=actor,
                made_at=timezone.now(),
                read_to=newest_record(),
            )
            webhook.robots.set(robots)
            slugs = [robot.slug for robot in robots]
            _record("webhook.create", webhook, actor, kinds=webhook.kinds, robots=slugs, texts=texts)
    except IntegrityError:
        raise WebhookRefused("name_taken", _("Another webhook has this name.")) from None
    return webhook, secret


def webhook_pause(*, webhook: Webhook, actor: User) -> None:
    """Pause a webhook: it sends nothing until it is resumed."""
    _require_staff(actor)
    with transaction.atomic():
        if Webhook.objects.filter(pk=webhook.pk, paused_at=None).update(paused_at=timezone.now()):
            _record("webhook.pause", webhook, actor)


def webhook_resume(*, webhook: Webhook, actor: User) -> None:
    """Resume a webhook after a pause, or after its owner left. `actor` becomes its owner."""
    _require_staff(actor)
    with transaction.atomic():
        if Webhook.objects.filter(pk=webhook.pk).update(paused_at=None, owner=actor):
            _record("webhook.resume", webhook, actor)


def webhook_delete(*, webhook: Webhook, actor: User) -> None:
    """Delete a webhook with its deliveries."""
    _require_staff(actor)
    with transaction.atomic():
        _record("webhook.delete", webhook, actor)
        webhook.delete()


def webhook_test(*, webhook: Webhook, actor: User) -> None:
    """Make a test delivery: the next round of housekeeping sends it."""
    _require_staff(actor)
    if webhook.paused_at or webhook.orphaned:
        raise WebhookRefused("paused", _("Resume it first: a paused webhook sends nothing."))
    now = timezone.now()
    WebhookDelivery.objects.create(webhook=webhook, record=None, kind=TEST, made_at=now, due_at=now)


def webhook_again(*, webhook: Webhook, actor: User) -> int:
    """Try the deliveries again that were given up. Return their number."""
    _require_staff(actor)
    given_up = webhook.deliveries.filter(state=WebhookDelivery.State.GIVEN_UP)
    return given_up.update(state=WebhookDelivery.State.WAITING, due_at=timezone.now(), answers=[])


def _require_staff(actor: User) -> None:
    if not (actor.is_active and actor.is_staff):
        raise WebhookRefused("not_staff", _("Webhooks are for staff."))


def _record(kind: str, webhook: Webhook, actor: User, **facts: Any) -> None:
    # Only the host of the address is recorded: the rest may be a secret of the receiver.
    private = {"name": webhook.name, "host": urlsplit(webhook.address).hostname}
    parameters = {"webhook": str(webhook.pk), **facts}
    record(kind, actor=actor, parameters=parameters, private=private)
