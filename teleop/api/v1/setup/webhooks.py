"""Webhooks, for staff: make, pause, resume, test and delete them, and read the log of their deliveries."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal
from uuid import UUID

from django.db.models import Count, Q
from django.utils.dateparse import parse_datetime
from msgspec import Meta, Struct
from rest_framework.response import Response

from fleet.accounts.tokens.models import Scope
from robots.registry.models import Robot
from teleop.api.v1.framework.operation import Entry, entry_of
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import SetupView, makes, manages
from teleop.control.allowed.scopes import scope_missing
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks import services
from teleop.webhooks.addresses import LONGEST

State = WebhookDelivery.State
SHOWN = 100  # deliveries
# The names of `EVENT_CATEGORIES`
EventCategoryName = Literal["alerts", "bookings", "control", "stops", "motions", "speech"]


class WebhookEntry(Struct, frozen=True):
    """A webhook. Nothing shows its secret again. `robots` empty: all."""

    id: UUID
    name: str
    address: str
    kinds: list[str]
    robots: list[str]
    texts: bool  # with spoken sentences and reasons
    paused: bool
    owner: str | None  # user name; if the owner is no longer staff, the webhook sends nothing
    sends: bool  # it is not paused, and its owner is staff
    made_at: Time
    waiting: int  # deliveries that are tried again
    given_up: int


class WebhookList(Struct, frozen=True):
    """Webhooks, by name."""

    webhooks: list[WebhookEntry]


class WebhookMade(WebhookEntry, frozen=True, kw_only=True):
    """A new webhook, with the secret that checks its signatures: shown once."""

    secret: str


class WebhookRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new webhook, for events from now on."""

    name: Annotated[str, Meta(min_length=1, max_length=80)]
    address: Annotated[str, Meta(min_length=1, max_length=LONGEST)]
    kinds: Annotated[list[EventCategoryName], Meta(min_length=1)]
    robots: Annotated[list[str], Meta(max_length=1000)] = []  # slugs; empty: all
    texts: bool = False


class WebhookChange(Struct, frozen=True, forbid_unknown_fields=True):
    """`paused`: send nothing, or go on; the person who resumes it becomes its owner. Other fields: a new webhook."""

    paused: bool


class Answer(Struct, frozen=True):
    """The answer to one attempt, or why there was none."""

    at: Time
    took_s: float
    status: int | None
    code: str | None
    text: str


class DeliveryEntry(Struct, frozen=True):
    """An event on its way. `record`: its number in the log; null: a test."""

    number: int
    type: str
    record: int | None
    made_at: Time
    state: Literal["waiting", "delivered", "given_up"]
    next_at: Time | None  # attempt
    answers: list[Answer]


class DeliveryList(Struct, frozen=True):
    """The newest deliveries, newest first."""

    deliveries: list[DeliveryEntry]


class TriedAgain(Struct, frozen=True):
    """Number of deliveries that are tried again."""

    deliveries: int


class WebhooksBase(SetupView):
    tag = "webhooks"

    def concerned(self, webhook_id: UUID | None = None, body: Any = None, **_asked: Any) -> Iterable[Robot]:
        return self.one(webhook_id).robots.all() if webhook_id else self.named_robots(body.robots)

    def seen(self) -> list[Webhook]:
        """Return the webhooks whose robots the token serves. Raises `Problem`: not staff."""
        self.staff()
        found = Webhook.objects.select_related("owner").prefetch_related("robots")
        found = found.annotate(
            waiting=Count("deliveries", filter=Q(deliveries__state=State.WAITING)),
            given_up=Count("deliveries", filter=Q(deliveries__state=State.GIVEN_UP)),
        )
        return [one for one in found if self.serves(one.robots.all())]

    def one(self, webhook_id: UUID) -> Webhook:
        """Return one of these webhooks. Raises `Problem`: not found."""
        found = next((one for one in self.seen() if one.pk == webhook_id), None)
        if found is None:
            raise Problem(NOT_FOUND)
        return found


class WebhooksView(WebhooksBase):
    @manages("webhooks_list", "List webhooks", refuses=())
    def get(self) -> WebhookList:
        """For staff."""
        return WebhookList([_entry(WebhookEntry, one) for one in self.seen()])

    @makes(
        "webhooks_make",
        "Make a webhook",
        answer=WebhookMade,
        refuses=(404, 409),
        examples={
            "Stops of one robot": {
                "name": "alarm",
                "address": "https://alarm.example.org/fleet",
                "kinds": ["stops"],
                "robots": ["tiago-1"],
            }
        },
    )
    def post(self, body: WebhookRequest) -> Response:
        """For staff; a token needs the scope `read`, too. The answer has its secret, which nothing shows again; so this
        takes no Idempotency-Key, and its name is taken by the first of two requests."""
        staff, robots = self.staff(), self.named_robots(body.robots)
        if self.token is not None and not self.token.opens(Scope.READ):
            # The webhook would send data that the token may not read
            raise Problem(scope_missing((Scope.READ,)))
        made, secret = services.webhook_make(
            name=body.name,
            address=body.address,
            kinds=body.kinds,
            robots=robots,
            texts=body.texts,
            actor=staff,
        )
        answer = _entry(WebhookMade, self.one(made.pk), secret=secret)
        return self.shown_once(answer, f"/api/v1/webhooks/{made.pk}")


class WebhookView(WebhooksBase):
    @manages("webhooks_read", "Read a webhook")
    def get(self, webhook_id: UUID) -> WebhookEntry:
        """For staff."""
        return _entry(WebhookEntry, self.one(webhook_id))

    @manages("webhooks_change", "Pause or resume a webhook")
    def patch(self, webhook_id: UUID, body: WebhookChange) -> WebhookEntry:
        """For staff. A paused webhook goes on with the events since then, of at most 7 days."""
        step = services.webhook_pause if body.paused else services.webhook_resume
        step(webhook=self.one(webhook_id), actor=self.staff())
        return _entry(WebhookEntry, self.one(webhook_id))

    @manages("webhooks_delete", "Delete a webhook")
    def delete(self, webhook_id: UUID) -> None:
        """For staff. Its deliveries are deleted, too."""
        services.webhook_delete(webhook=self.one(webhook_id), actor=self.staff())


class DeliveriesView(WebhooksBase):
    @manages("webhooks_deliveries", "Read the deliveries of a webhook")
    def get(self, webhook_id: UUID) -> DeliveryList:
        """The last 100, with the answer to each attempt."""
        found = self.one(webhook_id).deliveries.order_by("-pk")[:SHOWN]
        return DeliveryList([_delivery(one) for one in found])


class TestView(WebhooksBase):
    @manages("webhooks_test", "Send a test", refuses=(404, 409))
    def post(self, webhook_id: UUID) -> None:
        """It leaves within about two seconds, and is among the deliveries."""
        services.webhook_test(webhook=self.one(webhook_id), actor=self.staff())


class AgainView(WebhooksBase):
    @manages("webhooks_again", "Try deliveries again that were given up")
    def post(self, webhook_id: UUID) -> TriedAgain:
        """Sends each of these events once more, with the same pauses."""
        return TriedAgain(services.webhook_again(webhook=self.one(webhook_id), actor=self.staff()))


def _entry(kind: type[Entry], webhook: Webhook, /, **others: str) -> Entry:
    paused = webhook.paused_at is not None
    return entry_of(
        kind,
        webhook,
        robots=[robot.slug for robot in webhook.robots.all()],
        paused=paused,
        owner=webhook.owner.username if webhook.owner else None,
        sends=not paused and not webhook.orphaned,
        **others,
    )


def _delivery(one: WebhookDelivery) -> DeliveryEntry:
    waits = one.state == State.WAITING
    return entry_of(
        DeliveryEntry,
        one,
        number=one.pk,
        type=one.kind,
        next_at=one.due_at if waits else None,
        answers=[
            Answer(
                at=parse_datetime(answer["at"]) or one.made_at,
                took_s=answer.get("took_s", 0.0),
                status=answer.get("status"),
                code=answer.get("code"),
                text=answer.get("text", ""),
            )
            for answer in one.answers
        ],
    )
