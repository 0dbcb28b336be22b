"""Bookings, the policies that they follow, and periods in which a robot is out of service."""

from __future__ import annotations

from itertools import pairwise
from typing import Any
from uuid import uuid4

from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.utils import timezone
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from fleet.base.names import NameField
from robots.access.models import Course, RobotGroup
from robots.registry.models import Robot

WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
DAY_NAMES = (
    _("Monday"),
    _("Tuesday"),
    _("Wednesday"),
    _("Thursday"),
    _("Friday"),
    _("Saturday"),
    _("Sunday"),
)


MOST_INTERVALS = 6  # of opening hours in one day


class State(models.TextChoices):
    """The stored state of a booking. "In use" and "over" depend on the time: `selectors.stage_of`."""

    BOOKED = "booked", _("booked")
    AWAITING = "awaiting", _("awaiting approval")  # holds the slot
    OFFERED = "offered", _("offered from the waiting list")  # holds the slot until `offer_until`
    FINISHED = "finished", _("finished early")
    NO_SHOW = "no_show", _("not used")
    CANCELLED = "cancelled", _("cancelled")


class Shared(models.TextChoices):
    """The people who may drive in a booking beside its owner. In all hands it stays the owner's."""

    NO = "", _("one person")
    COURSE = "course", _("a course")  # a lesson: the people enrolled in the booking's course
    PEOPLE = "people", _("named people")  # a team: its `BookingMember`s


class Booking(models.Model):
    """One person's time on one robot: the half-open interval from `starts_at` to `ends_at`, UTC.

    `held_until` is the end of the time in which others cannot book. It is earlier than `ends_at` if the rest
    was given up. Overlaps are found by `starts_at` and `held_until`, never by `ends_at`.
    """

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    robot = models.ForeignKey(
        Robot, on_delete=models.PROTECT, related_name="bookings", verbose_name=_("robot")
    )
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.PROTECT,
        related_name="bookings",
        verbose_name=_("person"),
    )
    starts_at = models.DateTimeField(_("from"))
    ends_at = models.DateTimeField(_("to"))
    held_until = models.DateTimeField()
    state = models.CharField(_("state"), max_length=16, choices=State, default=State.BOOKED)
    course = models.ForeignKey(
        Course,
        null=True,
        blank=True,
        on_delete=models.SET_NULL,
        related_name="bookings",
        verbose_name=_("course"),
    )
    purpose = NameField(_("purpose"), max_length=120, blank=True)
    shared = models.CharField(
        _("shared by"), max_length=8, choices=Shared, blank=True, default="", db_default=""
    )
    # Length of a turn; None: no turns, each member takes the robot when it is free
    turn_min = models.PositiveSmallIntegerField(_("minutes per turn"), null=True, blank=True)
    # The tasks that it leaves to its members (`robots.shared.wire.LessonTasks`); None: everything
    tasks = models.JSONField(null=True, blank=True)
    record = models.BooleanField(_("record it"), null=True)  # wish: what the robot senses in it is recorded
    # Housekeeping has begun its recording, which ends then (`teleop.recordings.orders.of_bookings`)
    recorded_until = models.DateTimeField(null=True, blank=True, editable=False)
    line_held = models.BooleanField(null=True)  # the teacher holds the line: nobody is called
    series = models.UUIDField(null=True, blank=True)  # the same for all bookings of a weekly series
    overridden = models.BooleanField(null=True)  # booked or moved against the policy, with a recorded reason
    used_at = models.DateTimeField(null=True, blank=True)  # when the person first took control in this slot
    offer_until = models.DateTimeField(null=True, blank=True)
    reminded_at = models.DateTimeField(null=True, blank=True)
    # Grows with each change, so that two tabs cannot overwrite each other's changes
    version = models.PositiveIntegerField(default=1)
    made_at = models.DateTimeField()  # when it was made, moved to another start, approved or accepted
    changed_at = models.DateTimeField(null=True, editable=False)  # null: before there was this column

    class Meta:
        ordering = ["starts_at"]
        verbose_name = _("booking")
        verbose_name_plural = _("bookings")
        indexes = [
            models.Index(fields=["robot", "starts_at"], name="bookings_by_robot"),
            models.Index(fields=["person", "starts_at"], name="bookings_by_person"),
        ]
        constraints = [
            models.CheckConstraint(condition=Q(ends_at__gt=F("starts_at")), name="booking_ends_after_start"),
            models.CheckConstraint(
                condition=Q(held_until__gte=F("starts_at"), held_until__lte=F("ends_at")),
                name="booking_held_within",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.robot} {self.starts_at:%Y-%m-%d %H:%M}-{self.ends_at:%H:%M} UTC"

    def save(self, **options: Any) -> None:
        """Save, and note when. With `auto_now`, SQLite makes the table anew, without the triggers of `overlaps`."""
        self.changed_at = timezone.now()
        super().save(**options)

    @property
    def lesson_of(self) -> str:
        """Return the name of the course whose people share the booking; empty: it is no lesson."""
        return self.course.name if self.course is not None and self.shared == Shared.COURSE else ""


class BookingMember(models.Model):
    """A person who may drive in another person's booking: in a team, or because its owner handed control over."""

    booking = models.ForeignKey(Booking, on_delete=models.CASCADE, related_name="members")
    person = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="memberships")

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["booking", "person"], name="one_membership_per_booking_and_person"
            )
        ]

    def __str__(self) -> str:
        return f"{self.person} in {self.booking}"


class Turn(models.Model):
    """A person's turn in a shared booking: first in line, then called by name, then driving until `ends_at`.

    A turn that is interrupted (the teacher takes over, the page is gone) waits first in line again, with the
    seconds `left_s`. The database allows one turn at once in a booking, and one open turn of a person.
    """

    class State(models.TextChoices):
        """The state of a turn."""

        WAITING = "waiting", _("waiting")
        CALLED = "called", _("called")
        DRIVING = "driving", _("driving")
        DONE = "done", _("done")
        SKIPPED = "skipped", _("skipped")
        MISSED = "missed", _("missed")
        REFUSED = "refused", _("refused")  # the person might not drive when it was their turn

    booking = models.ForeignKey(Booking, on_delete=models.CASCADE, related_name="turns")
    person = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="turns")
    number = models.IntegerField()  # the place in line: the lowest is next
    state = models.CharField(max_length=8, choices=State, default=State.WAITING)
    called_at = models.DateTimeField(null=True, blank=True)
    began_at = models.DateTimeField(null=True, blank=True)
    ends_at = models.DateTimeField(null=True, blank=True)
    left_s = models.PositiveIntegerField(null=True, blank=True)  # None: a whole turn
    misses = models.PositiveSmallIntegerField(default=0)  # how often the person was called and did not come

    class Meta:
        ordering = ["number", "id"]
        constraints = [
            models.UniqueConstraint(
                fields=["booking"], condition=Q(state__in=("called", "driving")), name="one_turn_at_once"
            ),
            models.UniqueConstraint(
                fields=["booking", "person"],
                condition=Q(state__in=("waiting", "called", "driving")),
                name="one_open_turn_per_person",
            ),
        ]

    def __str__(self) -> str:
        return f"turn of {self.person}: {self.state}"


def _number(label: Any, least: int, most: int, **options: Any) -> models.PositiveIntegerField[Any, Any]:
    """Return a column for a whole number in these bounds."""
    bounds = [MinValueValidator(least), MaxValueValidator(most)]
    return models.PositiveIntegerField(label, validators=bounds, **options)


def _limit(label: Any, least: int, most: int) -> models.PositiveIntegerField[int | None, int | None]:
    """Return a column for a number in these bounds; None: no limit."""
    return _number(label, least, most, null=True, blank=True)


class Policy(models.Model):
    """The booking policy of one robot, of a robot group, or of all robots (both empty).

    A robot follows its own policy, else that of its group (the first group by name), else that of all robots.
    """

    robot = models.OneToOneField(
        Robot,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="booking_policy",
        verbose_name=_("robot"),
    )
    group = models.OneToOneField(
        RobotGroup,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="booking_policy",
        verbose_name=_("robot group"),
    )
    # By weekday in the lab's zone: {"mon": [["08:00", "12:00"], ["13:00", "20:00"]]}, in order. Missing weekday:
    # closed. Empty: always open.
    opening = models.JSONField(_("opening hours"), default=dict, blank=True)
    shortest_min = _number(_("shortest slot, minutes"), 1, 1440, default=15)
    longest_min = _number(_("longest slot, minutes"), 1, 10080, default=240)
    horizon_days = _number(_("days ahead that may be booked"), 0, 730, default=28)
    notice_min = _number(_("notice to book, minutes"), 0, 43200, default=0)
    cancel_notice_min = _number(_("notice to cancel, minutes"), 0, 43200, default=0)
    gap_min = _number(_("gap between bookings of one person, minutes"), 0, 10080, default=0)
    day_min = _limit(_("minutes per person and day"), 1, 1440)
    week_min = _limit(_("minutes per person and week"), 1, 10080)
    at_once = _limit(_("bookings to come per person"), 1, 1000)
    robots_at_once = _number(_("robots that one person may book for the same time"), 1, 100, default=1)
    # Not shorter than the warning that a driver in free time gets before the slot
    grace_min = _number(_("free again if not used for, minutes"), 5, 1440, default=15)
    needs_approval = models.BooleanField(_("a supervisor approves each booking"), default=False)
    free_time = models.BooleanField(_("unbooked time is free to take"), default=True)

    class Meta:
        verbose_name = _("booking policy")
        verbose_name_plural = _("booking policies")

    def __str__(self) -> str:
        return str(self.robot or self.group or _("all robots"))

    def clean(self) -> None:
        """Refuse opening hours and slot lengths that contradict each other."""
        for day, intervals in self.opening.items():
            name = {"day": DAY_NAMES[WEEKDAYS.index(day)]}
            if any(closes <= opens for opens, closes in intervals):
                raise ValidationError(_("On %(day)s the robot closes before it opens.") % name)
            if any(opens < closes for (_opens, closes), (opens, _closes) in pairwise(intervals)):
                raise ValidationError(_("On %(day)s two opening times overlap, or are not in order.") % name)
        if None not in (self.shortest_min, self.longest_min) and self.shortest_min > self.longest_min:
            raise ValidationError(_("The shortest slot is longer than the longest."))

    @property
    def of(self) -> str:
        """Return the name of the robot or group of this policy."""
        return self.robot.name if self.robot else self.group.name if self.group else gettext("all robots")


class OutOfService(models.Model):
    """A period in which a robot cannot be driven: repair, an empty battery, reserved for research."""

    class Why(models.TextChoices):
        """The reason."""

        REPAIR = "repair", _("repair")
        BATTERY = "battery", _("battery")
        RESEARCH = "research", _("reserved for research")
        OTHER = "other", _("other")

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    robot = models.ForeignKey(
        Robot, on_delete=models.CASCADE, related_name="out_of_service", verbose_name=_("robot")
    )
    starts_at = models.DateTimeField(_("from"))
    ends_at = models.DateTimeField(
        _("to"), null=True, blank=True, help_text=_("Empty: until further notice.")
    )
    why = models.CharField(_("reason"), max_length=16, choices=Why, default=Why.REPAIR)
    note = NameField(_("note"), max_length=200, blank=True)

    class Meta:
        ordering = ["starts_at"]
        verbose_name = _("out-of-service period")
        verbose_name_plural = _("out-of-service periods")

    def __str__(self) -> str:
        return f"{self.robot}: {self.get_why_display()}"

    def clean(self) -> None:
        """Refuse a period that ends before it begins."""
        if self.ends_at is not None and self.ends_at <= self.starts_at:
            raise ValidationError(_("The period ends before it begins: exchange the two times."))


class Holiday(models.Model):
    """Days on which no robot of the lab can be booked, both included."""

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    name = NameField(_("name"), max_length=80)
    first_day = models.DateField(_("first day"))
    last_day = models.DateField(_("last day"))

    class Meta:
        ordering = ["first_day", "name"]
        verbose_name = _("holiday")
        verbose_name_plural = _("holidays")
        constraints = [
            models.UniqueConstraint(fields=["first_day", "name"], name="holiday_once"),
        ]

    def __str__(self) -> str:
        return f"{self.name}, {self.first_day:%Y-%m-%d}"

    def clean(self) -> None:
        """Refuse a holiday that ends before it begins."""
        if self.last_day is not None and self.first_day is not None and self.last_day < self.first_day:
            raise ValidationError(_("The last day comes before the first: exchange them."))


class Waiting(models.Model):
    """A person in line for a robot: for a taken slot, or, without times, for control as soon as it is free.

    The first person gets the first offer. People who wait for control leave the line when their tab closes.
    """

    robot = models.ForeignKey(Robot, on_delete=models.CASCADE, related_name="waiting")
    person = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="waiting")
    starts_at = models.DateTimeField(null=True, blank=True)
    ends_at = models.DateTimeField(null=True, blank=True)
    since = models.DateTimeField()
    # Only for people who wait for a slot; the offer gets these:
    purpose = NameField(_("purpose"), max_length=120, blank=True, default="", db_default="")
    record = models.BooleanField(_("record it"), null=True)
    course = models.ForeignKey(
        Course, null=True, blank=True, on_delete=models.SET_NULL, related_name="waiting"
    )
    # Only for people who wait for control:
    tab = models.CharField(max_length=64, blank=True)
    sign_in = models.CharField(max_length=64, blank=True)
    connection = models.CharField(max_length=64, blank=True)
    seen_at = models.DateTimeField(null=True, blank=True)  # when the web process last saw the page
    offer_until = models.DateTimeField(null=True, blank=True)  # the person may take control until then

    class Meta:
        ordering = ["since", "id"]
        constraints = [
            models.UniqueConstraint(fields=["robot", "person", "starts_at"], name="wait_once_for_a_slot"),
            models.UniqueConstraint(
                fields=["robot", "person"], condition=Q(starts_at=None), name="wait_once_for_control"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.person} waits for {self.robot}"


class FeedAddress(models.Model):
    """A private URL at which calendar programs read the bookings of one person or of one robot.

    Only its digest is stored. A new address for the same purpose replaces the old one.
    """

    digest = models.CharField(max_length=64, primary_key=True)
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="feed_addresses"
    )
    robot = models.ForeignKey(
        Robot, null=True, blank=True, on_delete=models.CASCADE, related_name="feed_addresses"
    )
    made_at = models.DateTimeField()

    def __str__(self) -> str:
        return f"calendar of {self.robot or self.person}"


class Notification(models.Model):
    """A notification of a person: a notice on the pages until they have seen it, an e-mail, and a push.

    It is stored in the transaction of the change that it reports; housekeeping sends the e-mail. One with an
    `until` is about a moment, such as "your turn": it disappears then, and there is no e-mail of it.
    """

    person = models.ForeignKey(
        settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="notifications"
    )
    subject = models.CharField(max_length=200)
    text = models.TextField()
    # Only for the e-mail: place, purpose and link of the bookings; and iCalendar messages about them
    details = models.TextField(default="", db_default="")
    calendar = models.JSONField(null=True)
    path = models.CharField(max_length=200, blank=True, default="", db_default="")  # of the page to open
    until = models.DateTimeField(null=True, blank=True)
    # Its subject, so that several processes write it once; None: written with the change
    key = models.CharField(max_length=120, null=True, blank=True, unique=True)
    made_at = models.DateTimeField()
    claimed_at = models.DateTimeField(null=True, blank=True)  # when a process last began to send it
    # When the mail server took it, or refused its address
    sent_at = models.DateTimeField(null=True, blank=True)
    seen_at = models.DateTimeField(null=True, blank=True)  # when the person closed the notice

    class Meta:
        db_table = "bookings_letter"  # the former name of the model was Letter
        indexes = [
            models.Index(fields=["made_at"], condition=Q(sent_at=None), name="letters_to_send"),
            models.Index(fields=["person"], condition=Q(seen_at=None), name="letters_to_show"),
        ]

    def __str__(self) -> str:
        return self.subject


class Change(models.Model):
    """A change that took bookings, or parts of them, from people: a role, a course, a policy, a robot out of service.

    It is kept so that it can be undone: `rows` are as they were before, `losses` say what happened to which booking
    (`fleet.bookings.losses`).
    """

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    actor = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, on_delete=models.SET_NULL, related_name="changes_made"
    )
    made_at = models.DateTimeField()
    kind = models.CharField(max_length=64)  # of its record in the audit log
    about = models.CharField(max_length=200)  # courses, robots and the like, but no people
    rows = models.JSONField(default=list)  # empty: it cannot be undone
    losses = models.JSONField(default=list)
    archived = models.ForeignKey(  # the course that it archived: opening it again gives its bookings back
        Course, null=True, on_delete=models.SET_NULL, related_name="archivings"
    )
    undone_at = models.DateTimeField(null=True)
    undone_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, on_delete=models.SET_NULL, related_name="+"
    )

    class Meta:
        ordering = ["-made_at"]

    def __str__(self) -> str:
        return f"{self.kind}: {self.about}"


class HandOffer(models.Model):
    """A booking that its person wants to hand to a colleague. It moves, and counts for quotas, if they accept.

    `share`: the colleague is asked to share it instead, and is in its team after that.
    """

    class Outcome(models.TextChoices):
        """How it ended."""

        ACCEPTED = "accepted"
        DECLINED = "declined"
        WITHDRAWN = "withdrawn"
        LAPSED = "lapsed"

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    booking = models.ForeignKey(Booking, on_delete=models.CASCADE, related_name="hand_offers")
    version = models.PositiveIntegerField()  # of the booking: a booking that changes since is not handed over
    share = models.BooleanField(default=False, db_default=False)
    by = models.ForeignKey(settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="+")
    # None: whoever opens the link first. Only the digest of its code is stored.
    to = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, on_delete=models.CASCADE, related_name="hand_offers"
    )
    digest = models.CharField(max_length=64, blank=True, default="")
    made_at = models.DateTimeField()
    until = models.DateTimeField()
    outcome = models.CharField(max_length=16, choices=Outcome, blank=True, default="")  # empty: it is open

    class Meta:
        constraints = [
            models.UniqueConstraint(
                fields=["booking"],
                condition=Q(outcome="", share=False),
                name="one_open_hand_offer_per_booking",
            ),
            models.UniqueConstraint(
                fields=["digest"], condition=~Q(digest=""), name="one_hand_offer_per_link"
            ),
        ]

    def __str__(self) -> str:
        return f"{self.booking} to {self.to or 'whoever has the link'}"
