"""Robot groups, courses with their people, invitations, and qualifications.

`RobotRole`, a person's own role on one robot, is in `robots.registry.models`.
"""

from __future__ import annotations

from datetime import datetime, timedelta
from uuid import uuid4

from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator
from django.db import models
from django.db.models import F, Q
from django.utils import timezone
from django.utils.crypto import get_random_string
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from fleet.base.names import NameField
from robots.registry.models import Robot, Role

DRIVERS = "drivers"  # lessons count for the quotas of those who drove
ONE_SECOND = timedelta(seconds=1)
CODE_LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # no two of them look alike


class RobotGroup(models.Model):
    """A set of robots, such as "the TIAGos". Roles, courses and qualifications can name a group like a robot."""

    name = NameField(_("name"), max_length=80, unique=True)
    slug = models.SlugField(_("slug"), unique=True)
    robots = models.ManyToManyField(Robot, blank=True, related_name="groups", verbose_name=_("robots"))

    class Meta:
        ordering = ["name"]
        verbose_name = _("robot group")
        verbose_name_plural = _("robot groups")

    def __str__(self) -> str:
        return self.name


class GroupRole(models.Model):
    """The role of one person on every robot of a group."""

    group = models.ForeignKey(RobotGroup, on_delete=models.CASCADE, related_name="roles")
    user = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.CASCADE,
        related_name="group_roles",
        verbose_name=_("person"),
    )
    role = models.CharField(
        _("role"), max_length=16, choices=[choice for choice in Role.choices if choice[0] != Role.STAFF.value]
    )
    # The person has the role only while the claims at sign-in fit the rule
    by_rule = models.ForeignKey("SignInRule", null=True, blank=True, on_delete=models.SET_NULL)

    class Meta:
        ordering = ["user__username"]
        constraints = [
            models.UniqueConstraint(fields=["group", "user"], name="one_role_per_group_and_person")
        ]

    def __str__(self) -> str:
        return f"{self.user}: {self.role}"


def _minutes(most_hours: int) -> list[MinValueValidator | MaxValueValidator]:
    return [MinValueValidator(1), MaxValueValidator(most_hours * 60)]


class Course(models.Model):
    """People who have a role on some robots between two dates, both included, in the lab's time zone.

    Quotas are in minutes and limit the bookings that were made by the course; None: no quota.
    """

    name = NameField(_("name"), max_length=80, unique=True)
    slug = models.SlugField(_("slug"), unique=True)
    robots = models.ManyToManyField(Robot, blank=True, related_name="courses", verbose_name=_("robots"))
    groups = models.ManyToManyField(
        RobotGroup, blank=True, related_name="courses", verbose_name=_("robot groups")
    )
    role = models.CharField(
        _("role"),
        max_length=16,
        choices=[choice for choice in Role.choices if choice[0] in (Role.OBSERVER, Role.OPERATOR)],
        default=Role.OPERATOR,
    )
    starts_on = models.DateField(_("first day"))
    ends_on = models.DateField(_("last day"))
    week_min = models.PositiveIntegerField(
        _("minutes per person and week"), null=True, blank=True, validators=_minutes(168)
    )
    day_min = models.PositiveIntegerField(
        _("minutes per person and day"), null=True, blank=True, validators=_minutes(24)
    )
    at_once = models.PositiveIntegerField(
        _("bookings to come per person"),
        null=True,
        blank=True,
        validators=[MinValueValidator(1), MaxValueValidator(1000)],
    )
    course_week_min = models.PositiveIntegerField(
        _("minutes per week for the whole course"), null=True, blank=True, validators=_minutes(168 * 1000)
    )
    lessons_count = models.CharField(
        _("lessons count for the quotas of"),
        max_length=8,
        choices=[("nobody", _("nobody")), (DRIVERS, _("those who drove"))],
        default="nobody",
        db_default="nobody",
    )
    record_lessons = models.BooleanField(_("record every lesson"), default=False, db_default=False)
    supervisors = models.ManyToManyField(
        settings.AUTH_USER_MODEL,
        blank=True,
        related_name="supervised_courses",
        verbose_name=_("supervisors"),
    )
    archived = models.BooleanField(_("archived"), default=False)

    class Meta:
        ordering = ["archived", "-ends_on", "name"]
        verbose_name = _("course")
        verbose_name_plural = _("courses")
        constraints = [
            models.CheckConstraint(
                condition=Q(ends_on__gte=F("starts_on")),
                name="course_ends_after_start",
                violation_error_message=_("The last day must not be before the first day."),
            )
        ]

    def __str__(self) -> str:
        return self.name


class SignInRule(models.Model):
    """A rule of single sign-on: people whose claim has a value are in a course, or have a role on a robot group.

    `claim` is a name in the answer of the provider; dots lead into objects, such as `realm_access.roles`.
    """

    claim = NameField(_("claim"), max_length=100, default="groups")
    value = NameField(_("value"), max_length=200)
    course = models.ForeignKey(
        Course,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="sign_in_rules",
        verbose_name=_("course"),
    )
    group = models.ForeignKey(
        RobotGroup,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="sign_in_rules",
        verbose_name=_("robot group"),
    )
    role = models.CharField(
        _("role"),
        max_length=16,
        blank=True,
        choices=[choice for choice in Role.choices if choice[0] != Role.STAFF.value],
    )

    class Meta:
        ordering = ["claim", "value", "pk"]
        verbose_name = _("sign-in rule")
        verbose_name_plural = _("sign-in rules")
        constraints = [
            models.UniqueConstraint(
                fields=["claim", "value", place],
                name=f"one_sign_in_rule_of_a_{place}",
                violation_error_message=_("There is such a rule already."),
            )
            for place in ("course", "group")
        ]

    def __str__(self) -> str:
        return f"{self.claim} = {self.value}"

    def clean(self) -> None:
        """Require a course, or a robot group with a role."""
        if (self.course is None) == (self.group is None):
            raise ValidationError(_("Choose a course or a robot group, one of the two."))
        if self.group is not None and not self.role:
            raise ValidationError(_("Choose a role on the robot group."))
        if self.course is not None:
            self.role = ""  # the course has it


class Enrolment(models.Model):
    """A person in a course."""

    course = models.ForeignKey(
        Course, on_delete=models.CASCADE, related_name="enrolments", verbose_name=_("course")
    )
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.CASCADE,
        related_name="enrolments",
        verbose_name=_("person"),
    )
    added_at = models.DateTimeField(_("since"), default=timezone.now)
    # As the registry of this course gives it. Of the enrolment, not of the account: no other course reads or sets it
    number = models.CharField(_("student number"), max_length=40, blank=True)
    # The person is in the course only while the claims at sign-in fit the rule
    by_rule = models.ForeignKey(SignInRule, null=True, blank=True, on_delete=models.SET_NULL)

    class Meta:
        verbose_name = _("enrolment")
        verbose_name_plural = _("enrolments")
        constraints = [
            models.UniqueConstraint(fields=["course", "person"], name="one_enrolment_per_course_and_person"),
            models.UniqueConstraint(
                fields=["course", "number"], condition=~Q(number=""), name="one_person_per_course_and_number"
            ),
        ]

    def __str__(self) -> str:
        return gettext("%(person)s in %(course)s") % {"person": self.person, "course": self.course}


def new_code() -> str:
    """Return a secret that people can type: three groups of four letters or digits; 59 bits."""
    return "-".join(get_random_string(4, CODE_LETTERS) for _group in range(3))


class Invitation(models.Model):
    """A link by which people enrol themselves in a course."""

    id = models.UUIDField(primary_key=True, default=uuid4, editable=False)
    code = models.CharField(max_length=14, unique=True, default=new_code, editable=False)
    course = models.ForeignKey(
        Course, on_delete=models.CASCADE, related_name="invitations", verbose_name=_("course")
    )
    made_by = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        null=True,
        on_delete=models.SET_NULL,
        related_name="+",
        verbose_name=_("made by"),
    )
    made_at = models.DateTimeField(_("made"), default=timezone.now)
    expires_at = models.DateTimeField(_("expires"))
    most_uses = models.PositiveIntegerField(
        _("people at most"), validators=[MinValueValidator(1), MaxValueValidator(5000)]
    )
    uses = models.PositiveIntegerField(_("people so far"), default=0)
    revoked_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        ordering = ["-made_at"]
        verbose_name = _("invitation")
        verbose_name_plural = _("invitations")

    def __str__(self) -> str:
        return gettext("invitation to %s") % self.course

    @property
    def last_moment(self) -> datetime:
        """Return the last second of the day that was typed. `expires_at` is the midnight after this day."""
        return self.expires_at - ONE_SECOND


class PasswordLink(models.Model):
    """The link by which a person sets a password. A person has one: a new one ends the old one."""

    person = models.OneToOneField(
        settings.AUTH_USER_MODEL, on_delete=models.CASCADE, related_name="password_link"
    )
    digest = models.CharField(max_length=64, unique=True)  # SHA-256 of the link's code
    sealed = models.TextField()  # the code, encrypted, so that the same link can be shown again
    mark = models.CharField(max_length=16)  # of password and last sign-in: later ones end the link
    # When others saw the link of an account that nobody had used: it ends when the account gains anything later
    seen_at = models.DateTimeField(null=True, blank=True)
    # The only person who saw it; None: several people, or whoever opened an invitation
    seen_by = models.ForeignKey(
        settings.AUTH_USER_MODEL, null=True, blank=True, on_delete=models.SET_NULL, related_name="+"
    )
    expires_at = models.DateTimeField()

    def __str__(self) -> str:
        return gettext("link of %s") % self.person

    @property
    def last_moment(self) -> datetime:
        """Return the last second of its last day. `expires_at` is the midnight after this day."""
        return self.expires_at - ONE_SECOND


class Qualification(models.Model):
    """Something that a person needs to drive certain robots, such as a safety training."""

    name = NameField(_("name"), max_length=80, unique=True)
    slug = models.SlugField(_("slug"), unique=True)
    description = NameField(
        _("description"), max_length=300, blank=True, help_text=_("Where and how people get it.")
    )
    robots = models.ManyToManyField(
        Robot, blank=True, related_name="qualifications", verbose_name=_("demanded by robots")
    )
    groups = models.ManyToManyField(
        RobotGroup, blank=True, related_name="qualifications", verbose_name=_("demanded by groups")
    )

    class Meta:
        ordering = ["name"]
        verbose_name = _("qualification")
        verbose_name_plural = _("qualifications")

    def __str__(self) -> str:
        return self.name


class QualificationGrant(models.Model):
    """A person has a qualification until `expires_at`, or without end."""

    qualification = models.ForeignKey(
        Qualification, on_delete=models.CASCADE, related_name="grants", verbose_name=_("qualification")
    )
    person = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.CASCADE,
        related_name="qualification_grants",
        verbose_name=_("person"),
    )
    granted_by = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        null=True,
        on_delete=models.SET_NULL,
        related_name="+",
        verbose_name=_("granted by"),
    )
    granted_at = models.DateTimeField(_("granted"), default=timezone.now)
    expires_at = models.DateTimeField(_("expires"), null=True, blank=True)

    class Meta:
        verbose_name = _("granted qualification")
        verbose_name_plural = _("granted qualifications")
        constraints = [
            models.UniqueConstraint(
                fields=["qualification", "person"], name="one_grant_per_qualification_and_person"
            )
        ]

    def __str__(self) -> str:
        return gettext("%(qualification)s of %(person)s") % {
            "qualification": self.qualification,
            "person": self.person,
        }

    @property
    def last_moment(self) -> datetime | None:
        """Return the last second of the day that was typed; None if the grant has no end."""
        return self.expires_at and self.expires_at - ONE_SECOND
