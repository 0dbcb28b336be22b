"""Entries of profiles and robots: phrases and allow-lists."""

from __future__ import annotations

from django.core.exceptions import ValidationError
from django.core.validators import RegexValidator
from django.db import models
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from fleet.base.formats.sentences import in_words
from robots.registry import phrases
from robots.registry.configuration import profile_schema, robot_config
from robots.registry.models.registry import Robot, RobotProfile, Role, topic_name
from robots.shared.configuration.bridge_config import CLIENTS, Topics
from robots.shared.configuration.denylist import why_denied


class OfProfileOrRobot(models.Model):
    """An entry of a profile, or an additional entry of one robot."""

    profile = models.ForeignKey(
        RobotProfile,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="%(class)ss",
        verbose_name=_("profile"),
    )
    robot = models.ForeignKey(
        Robot,
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="%(class)ss",
        verbose_name=_("robot"),
    )

    class Meta:
        abstract = True
        constraints = [
            models.CheckConstraint(
                condition=models.Q(profile__isnull=False) ^ models.Q(robot__isnull=False),
                name="%(class)s_of_profile_or_robot",
                violation_error_message=_("Name either a profile or a robot."),
            )
        ]

    @property
    def owner(self) -> RobotProfile | Robot:
        owner = self.profile or self.robot
        if owner is None:
            raise ValueError(f"this {self._meta.verbose_name} belongs to no profile and to no robot")
        return owner


def check_phrase_language(code: str) -> None:
    if why := phrases.why_no_language(code):
        raise ValidationError(in_words(why))


def check_phrase_text(text: str) -> None:
    if why := phrases.why_no_phrase(text):
        raise ValidationError(in_words(why))


class Phrase(OfProfileOrRobot):
    """A ready-made message."""

    text = models.TextField(
        _("text"),
        validators=[check_phrase_text],
        help_text=_("One line, at most 500 characters, in its own script."),
    )
    language = models.CharField(
        _("language"),
        max_length=35,
        validators=[check_phrase_language],
        help_text=_("Such as en-GB (BCP 47)."),
    )
    order = models.PositiveIntegerField(_("order"), default=0, help_text=_("Small numbers come first."))
    tags = models.CharField(
        _("tags"),
        max_length=phrases.LONGEST_TAGS,
        blank=True,
        help_text=_("Words to find it by, separated by commas."),
    )

    class Meta(OfProfileOrRobot.Meta):
        ordering = ["order", "id"]
        verbose_name = _("phrase")
        verbose_name_plural = _("phrases")

    def __str__(self) -> str:
        # Isolate the text's direction, including its full stop.
        return f"{self.language}: \u2068{self.text}\u2069"

    def clean(self) -> None:
        """Normalise language and tags."""
        self.language = phrases.in_usual_case(self.language)
        tags = phrases.tags_in(self.tags)
        if why := phrases.why_no_tags(tags):
            raise ValidationError(in_words(why))
        self.tags = phrases.tags_text(tags)

    @property
    def line(self) -> phrases.Line:
        """Return the phrase as a line of a file."""
        return phrases.Line(self.text, self.language, phrases.tags_in(self.tags))


class Allowance(OfProfileOrRobot):
    """An entry of the allow-list. Use of a name without an entry is refused.

    `robots.shared.configuration.denylist` forbids some entries.
    """

    class What(models.TextChoices):
        """Use of the name."""

        CHOOSE = "choose", _("choose: input goes to this topic or action")
        PUBLISH = "publish", _("publish on this topic")
        CALL = "call", _("call this service (staff only)")
        SET = "set", _("set this parameter (staff only)")

    class Use(models.TextChoices):
        """Kind of input."""

        DRIVE = "drive", _("driving")
        SPEECH = "speech", _("speech")
        MOTIONS = "motions", _("motions")

    TYPED = (What.PUBLISH, What.CALL)

    what = models.CharField(_("what"), max_length=8, choices=What.choices)
    use = models.CharField(
        _("input"),
        max_length=8,
        choices=Use.choices,
        blank=True,
        help_text=_(
            "For *choose*: the input that goes there. For driving it decides what wins over the console. "
            "On TIAGo /phone_vel (priority 98) and /key_vel (90) pass through twist_mux: the lab’s joystick and "
            "every lock win. /nav_vel and /servoing_cmd_vel (10, 20): every other input wins, too. /joy_vel and "
            "/tab_vel (100, not masked by emergency_brake) and a controller’s own topic are refused here."
        ),
    )
    name = models.CharField(
        _("name"),
        max_length=200,
        validators=[topic_name],
        help_text=_("Full name of the topic, action, service or parameter."),
    )
    type = models.CharField(
        _("type"),
        max_length=120,
        blank=True,
        validators=[
            RegexValidator(
                r"^[A-Za-z][A-Za-z0-9_]*/((msg|srv|action)/)?[A-Za-z][A-Za-z0-9_]*$",
                _("Write package and type, such as std_msgs/String."),
            )
        ],
        help_text=_(
            "Needed for publish and call, such as std_msgs/String or std_srvs/Trigger; otherwise leave it empty."
        ),
    )
    role = models.CharField(
        _("lowest role"),
        max_length=16,
        choices=[choice for choice in Role.choices if choice[0] != Role.OBSERVER.value],
        default=Role.OPERATOR,
        help_text=_("The lowest role that may use it. Services and parameters are always for staff only."),
    )

    class Meta(OfProfileOrRobot.Meta):
        ordering = ["what", "use", "name"]
        constraints = [
            *OfProfileOrRobot.Meta.constraints,
            models.UniqueConstraint(
                fields=["profile", "what", "use", "name"], name="one_allowance_per_profile_and_name"
            ),
            models.UniqueConstraint(
                fields=["robot", "what", "use", "name"], name="one_allowance_per_robot_and_name"
            ),
        ]
        verbose_name = _("allow-list entry")
        verbose_name_plural = _("allow-list entries")

    def __str__(self) -> str:
        return f"{in_words(self.what)} {self.name}"

    def clean(self) -> None:
        """Fill in derived fields; raise `ValidationError` if the entry is not allowed."""
        if self.what in (self.What.CALL, self.What.SET) and not self.name.startswith(CLIENTS):
            self.role = Role.STAFF
        errors: dict[str, str] = {}
        if (self.what == self.What.CHOOSE) != bool(self.use):
            errors["use"] = (
                gettext("Choose the input that goes there.")
                if not self.use
                else gettext("Only for “choose”: leave it empty.")
            )
        if self.what in self.TYPED and not self.type:
            errors["type"] = gettext("Publishing and calling need a type.")
        if self.what == self.What.SET and self.type:
            errors["type"] = gettext("A parameter has no type: leave it empty.")
        if errors:
            raise ValidationError(errors)
        self._judge()

    def _judge(self) -> None:
        topics = self._topics()
        if self.use and not self.type and topics is not None:
            default = getattr(topics, self.use)
            self.type = default.type if default else ""
        if why := self.why_nothing:
            text = gettext("%(name)s can never be allowed: %(why)s.") % {"name": self.name, "why": why}
            raise ValidationError({"name": text})

    @property
    def why_nothing(self) -> str:
        """Return why the entry has no effect (its owner was edited later, or this version forbids it), or ""."""
        if self.what in self.TYPED and not self.type:
            return gettext("it names no type")
        topics = self._topics()
        why = topics and why_denied(self.what, self.name, self.type, topics, self.use)
        return in_words(why) if why else ""

    def _topics(self) -> Topics | None:
        """Return the topics of the entry's robot or profile; None if these are wrong."""
        try:
            if self.robot is not None:
                return robot_config.topics(self.robot)
            return robot_config.profile_topics(self.profile) if self.profile is not None else None
        except profile_schema.Problems:
            return None
