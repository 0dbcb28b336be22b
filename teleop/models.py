"""Control sessions, leases, shared layouts and recordings, webhooks, devices that get notifications, alerts."""

from __future__ import annotations

from uuid import uuid4

from django.conf import settings
from django.core.validators import MaxValueValidator
from django.db import models
from django.db.models import Q
from django.db.models.functions import Lower
from django.utils.translation import gettext_lazy as _

from fleet.accounts.sign_in.devices import device_of
from fleet.base.names import NameField
from fleet.bookings.models import Notification
from robots.access.models import Course
from robots.recordings.models import Recording
from robots.registry.models import Robot
from robots.shared.sentences import Sentence, sentence_of


def named(person: str, program: str | None) -> str:
    """Return a person's name, followed by the name of the program that acts for the person, if any."""
    return f"{person} ({program})" if program else person


class EndReason(models.TextChoices):
    """Why a control session ended."""

    RELEASED = "released", _("given back")
    MOVED = "moved", _("moved to another tab of the same person")
    HANDED_OVER = "handed_over", _("handed over")
    TAKEN_OVER = "taken_over", _("taken over")
    TERM = "term", _("the term ended")
    SLOT = "slot", _("the slot ended, or another person’s slot began")
    AWAY = "away", _("the page was gone")
    RIGHT = "right", _("the right to control ended")
    BRIDGE = "bridge", _("the robot’s bridge refused it")


class ControlSession(models.Model):
    """One person's control of one robot, from taking control to its end."""

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    robot = models.ForeignKey(
        Robot, on_delete=models.PROTECT, related_name="control_sessions", verbose_name=_("robot")
    )
    user = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.PROTECT,
        related_name="control_sessions",
        verbose_name=_("person"),
    )
    # The name of the token with which a program took control; null: a person took control in a browser.
    program = models.CharField(_("program"), max_length=40, null=True, blank=True)  # noqa: DJ001 - added later
    fence = models.BigIntegerField(_("fence"))
    started_at = models.DateTimeField(_("began"))
    ended_at = models.DateTimeField(_("ended"), null=True, blank=True)
    end_reason = models.CharField(_("how it ended"), max_length=16, choices=EndReason, blank=True)

    class Meta:
        ordering = ["-started_at"]
        verbose_name = _("control session")
        verbose_name_plural = _("control sessions")
        indexes = [
            models.Index(fields=["started_at"], name="session_start"),
            models.Index(fields=["robot", "started_at"], name="session_start_by_robot"),
        ]
        constraints = [
            models.UniqueConstraint(fields=["robot", "fence"], name="one_session_per_fence"),
            models.UniqueConstraint(
                fields=["robot"], condition=Q(ended_at=None), name="one_open_session_per_robot"
            ),
        ]

    def __str__(self) -> str:
        return _("%(person)s on %(robot)s from %(time)s") % {
            "person": self.user,
            "robot": self.robot,
            "time": f"{self.started_at:%Y-%m-%d %H:%M}",
        }

    @property
    def holder_name(self) -> str:
        """Return the name that people see: the person's name, followed by the name of the program, if any."""
        return named(self.user.display_name, self.program)


class Lease(models.Model):
    """The lease of a robot: one row per robot, written by conditional updates only."""

    robot = models.OneToOneField(Robot, primary_key=True, on_delete=models.CASCADE, related_name="lease")
    session = models.OneToOneField(ControlSession, null=True, blank=True, on_delete=models.PROTECT)
    tab = models.CharField(max_length=64, blank=True)
    sign_in = models.CharField(max_length=64, blank=True)
    connection = models.CharField(max_length=64, blank=True)
    role = models.CharField(max_length=16, blank=True)
    term_ends_at = models.DateTimeField(null=True, blank=True)
    seen_at = models.DateTimeField(null=True, blank=True)

    def __str__(self) -> str:
        return f"lease of {self.robot}"


class SharedLayout(models.Model):
    """A layout of a robot's control page, for everybody who sees the robot (`teleop.layouts`)."""

    robot = models.ForeignKey(Robot, on_delete=models.CASCADE, related_name="layouts")
    name = NameField(_("name"), max_length=40)
    # As in `fleet.accounts.layouts.Layout`.
    cells = models.JSONField(default=list, blank=True)
    side = models.BooleanField(default=True)
    stick = models.BooleanField(default=True)
    panels = models.JSONField()

    class Meta:
        ordering = ["name"]
        constraints = [
            models.UniqueConstraint("robot", Lower("name"), name="one_layout_per_robot_and_name"),
        ]

    def __str__(self) -> str:
        return self.name


class RecordingShare(models.Model):
    """A whole recording that one person or one course may see, beside those who see it anyway."""

    recording = models.ForeignKey(Recording, on_delete=models.CASCADE, related_name="shares")
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, blank=True, on_delete=models.CASCADE, related_name="+"
    )
    course = models.ForeignKey(Course, null=True, blank=True, on_delete=models.CASCADE, related_name="+")
    made_at = models.DateTimeField()

    class Meta:
        constraints = [
            models.CheckConstraint(
                condition=Q(person=None) ^ Q(course=None), name="recording_shared_with_person_or_course"
            ),
            models.UniqueConstraint(fields=["recording", "person"], name="one_share_per_person"),
            models.UniqueConstraint(fields=["recording", "course"], name="one_share_per_course"),
        ]

    def __str__(self) -> str:
        return f"{self.recording}: {self.person or self.course}"


class Webhook(models.Model):
    """An address to which housekeeping sends events from the audit log (`teleop.webhooks`)."""

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    name = NameField(_("name"), max_length=80, unique=True)
    address = models.CharField(_("address"), max_length=500)
    secret = models.TextField()  # encrypted; the receiver checks signatures with it
    kinds = models.JSONField(default=list)  # names of `teleop.webhooks.events.EVENT_CATEGORIES`
    robots = models.ManyToManyField(Robot, blank=True, related_name="+")  # empty: all robots
    texts = models.BooleanField(default=False)  # events contain spoken sentences and reasons
    owner = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, on_delete=models.SET_NULL, related_name="webhooks"
    )
    made_at = models.DateTimeField()
    paused_at = models.DateTimeField(null=True, blank=True)
    read_to = models.BigIntegerField()  # order number of the last record that was read for this webhook

    class Meta:
        ordering = ["name"]

    def __str__(self) -> str:
        return self.name

    @property
    def orphaned(self) -> bool:
        """Return whether the owner is no longer staff. The console then sends nothing to this webhook."""
        return self.owner is None or not (self.owner.is_active and self.owner.is_staff)


class WebhookDelivery(models.Model):
    """One event on its way to a webhook, and the answers. The event itself stays in the audit log."""

    class State(models.TextChoices):
        WAITING = "waiting", _("waiting")
        DELIVERED = "delivered", _("delivered")
        GIVEN_UP = "given_up", _("given up")

    webhook = models.ForeignKey(Webhook, on_delete=models.CASCADE, related_name="deliveries")
    record = models.BigIntegerField(null=True)  # order number; None: a test
    kind = models.CharField(max_length=64)
    made_at = models.DateTimeField()
    state = models.CharField(max_length=16, choices=State, default=State.WAITING)
    due_at = models.DateTimeField()  # time of the next attempt; a claim moves it into the future
    answers = models.JSONField(default=list)  # one for each attempt

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["webhook", "record"], name="webhook_record_once"),
        ]
        indexes = [
            models.Index(fields=["webhook", "state", "due_at"], name="webhook_due"),
            models.Index(fields=["made_at"], name="webhook_delivery_age"),
        ]

    def __str__(self) -> str:
        return f"{self.kind} to {self.webhook_id}"


class PushKey(models.Model):
    """The console's key for push services, one row. Made at the first start, encrypted like secrets of webhooks."""

    id = models.PositiveSmallIntegerField(primary_key=True)
    private = models.TextField()

    def __str__(self) -> str:
        return "key for push services"


class PushSubscription(models.Model):
    """A browser that gets its person's notifications, at an address of its maker's push service (`teleop.push`)."""

    person = models.ForeignKey(
        settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="push_subscriptions"
    )
    endpoint = models.CharField(max_length=500)
    digest = models.CharField(max_length=64, unique=True)  # of the endpoint: a browser belongs to one person
    p256dh = models.CharField(max_length=100)  # the browser's public key
    auth = models.CharField(max_length=40)  # and its secret: only the browser can read what is sent
    user_agent = models.CharField(max_length=300, blank=True)
    made_at = models.DateTimeField()
    failures = models.PositiveSmallIntegerField(default=0)  # notifications given up since one arrived

    class Meta:
        ordering = ["made_at"]

    def __str__(self) -> str:
        return f"device of {self.person}"

    @property
    def device(self) -> str:
        """Return the browser and its system in plain words."""
        return device_of(self.user_agent)


class PushDelivery(models.Model):
    """A notification on its way to a browser."""

    subscription = models.ForeignKey(PushSubscription, on_delete=models.CASCADE, related_name="deliveries")
    notification = models.ForeignKey(Notification, on_delete=models.CASCADE, related_name="pushes")
    due_at = models.DateTimeField(db_index=True)  # time of the next attempt; a claim moves it into the future
    tries = models.PositiveSmallIntegerField(default=0)

    def __str__(self) -> str:
        return f"{self.notification_id} to {self.subscription_id}"


class KeyedRequest(models.Model):
    """A request of a program with an Idempotency-Key, and its answer. The console keeps both for a day."""

    digest = models.CharField(max_length=64, primary_key=True)  # of the sign-in and the key
    request = models.CharField(max_length=64)  # digest of method, address and body
    person = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="+")
    made_at = models.DateTimeField(db_index=True)
    status = models.PositiveSmallIntegerField(null=True)  # None: the request is not done yet
    body = models.JSONField(null=True)
    headers = models.JSONField(default=dict)

    def __str__(self) -> str:
        return self.digest


class Alert(models.Model):
    """Something that needs somebody, from its begin to its end; kept for 90 days (`teleop.alerts`)."""

    kind = models.CharField(max_length=16)  # of `teleop.alerts.kinds`
    subject = models.CharField(max_length=200, blank=True)  # which one of its kind, such as a robot's slug
    robot = models.ForeignKey(Robot, null=True, on_delete=models.CASCADE, related_name="alerts")
    said = models.JSONField()  # key and figures of its sentence
    began_at = models.DateTimeField()
    seen_at = models.DateTimeField()  # when a process found it last
    told_at = models.DateTimeField(null=True)  # recorded, so that webhooks tell it
    mailed_at = models.DateTimeField(null=True)
    mails = models.PositiveIntegerField(default=0)
    over_at = models.DateTimeField(null=True)

    class Meta:
        ordering = ["-began_at"]
        constraints = [
            models.UniqueConstraint(
                fields=["kind", "subject"], condition=Q(over_at=None), name="one_open_alert_per_subject"
            ),
        ]
        indexes = [models.Index(fields=["robot", "began_at"], name="alert_of_a_robot")]

    def __str__(self) -> str:
        return str(self.words)

    @property
    def words(self) -> Sentence:
        """Return its sentence, with key and figures."""
        return sentence_of(self.said)


class AlertRule(models.Model):
    """The readers of alerts of a kind, and times of letters. Without a row, the rule of `teleop.alerts.kinds` holds."""

    kind = models.CharField(primary_key=True, max_length=16)
    active = models.BooleanField(_("on"), default=True)
    after_min = models.PositiveIntegerField(_("after minutes"), validators=[MaxValueValidator(10_080)])
    again_h = models.PositiveIntegerField(
        _("again after hours"), validators=[MaxValueValidator(720)], help_text=_("0: only once.")
    )
    mail = models.BooleanField(_("e-mail"), default=True)
    to = models.TextField(_("to"), blank=True, max_length=2000, help_text=_("Addresses. Empty: all staff."))
    quiet_from = models.TimeField(_("no e-mail from"), null=True, blank=True)
    quiet_until = models.TimeField(_("until"), null=True, blank=True)

    def __str__(self) -> str:
        return self.kind

    @property
    def addresses(self) -> list[str]:
        """Return the addresses of `to`."""
        return self.to.replace(",", " ").replace(";", " ").split()
