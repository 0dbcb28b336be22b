"""The registry: kinds of robots, robots, who may do what with them, what they say, and how their bridges fare."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from typing import TypeVar

import msgspec
from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator, RegexValidator
from django.db import models
from django.utils.functional import cached_property
from django.utils.text import format_lazy
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from robots import described, effective, phrases
from robots.bridge import stick
from robots.bridge.config import Topics
from robots.bridge.never import USE_TYPES, why_never

T = TypeVar("T")

_topic_name = RegexValidator(
    r"^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$",
    _("Write a full ROS name such as /key_vel: a leading slash, then letters, digits and _."),
)


def _between(lowest: float, highest: float) -> list[MinValueValidator | MaxValueValidator]:
    return [MinValueValidator(lowest), MaxValueValidator(highest)]


class Role(models.TextChoices):
    """What a person may do with a robot; ordered, each role includes those below it.

    Staff is no row: `User.is_staff` means staff on every robot.
    """

    OBSERVER = "observer", _("Observer: may look, and stop")
    OPERATOR = "operator", _("Operator: may drive")
    SUPERVISOR = "supervisor", _("Supervisor: may also take over control")
    STAFF = "staff", _("Staff: everything, on every robot")

    @property
    def rank(self) -> int:
        """Place in the order, from 0."""
        return list(Role).index(self)

    # str would compare the letters.
    def __lt__(self, other: str) -> bool:
        return self.rank < Role(other).rank

    def __le__(self, other: str) -> bool:
        return self.rank <= Role(other).rank

    def __gt__(self, other: str) -> bool:
        return self.rank > Role(other).rank

    def __ge__(self, other: str) -> bool:
        return self.rank >= Role(other).rank


class ReverseSteering(models.TextChoices):
    """What stick left means while reversing."""

    TURN = "turn", _("Stick left always turns the robot left")
    CAR = "car", _("Like a car: mirrored in reverse")


def default_stick() -> list[dict[str, float | str]]:
    """The steps of a profile that does not say otherwise."""
    steps: list[dict[str, float | str]] = msgspec.to_builtins(list(stick.DEFAULT))
    return steps


class RobotProfile(models.Model):
    """What a kind of robot has in common."""

    slug = models.SlugField(_("slug"), unique=True)
    name = models.CharField(_("name"), max_length=80)
    holonomic = models.BooleanField(
        _("holonomic"), default=False, help_text=_("The base can also move sideways.")
    )

    forward_mps = models.FloatField(
        _("forward, m/s"),
        validators=_between(0.05, 3.0),
        help_text=_("The fastest that this kind of robot goes."),
    )
    reverse_mps = models.FloatField(
        _("reverse, m/s"),
        validators=_between(0.0, 3.0),
        help_text=_("A positive number. TIAGo's own limit is 0.2."),
    )
    lateral_mps = models.FloatField(
        _("sideways, m/s"),
        default=0.0,
        validators=_between(0.0, 3.0),
        help_text=_("0 unless the base is holonomic."),
    )
    turn_radps = models.FloatField(_("turning, rad/s"), validators=_between(0.05, 6.3))
    linear_mps2 = models.FloatField(
        _("acceleration, m/s²"),
        validators=_between(0.05, 10.0),
        help_text=_("What the base can speed up and brake with; the gate plans with a share of it."),
    )
    angular_radps2 = models.FloatField(_("angular acceleration, rad/s²"), validators=_between(0.05, 20.0))
    blind_mps = models.FloatField(
        _("blind speed, m/s"),
        validators=_between(0.01, 0.5),
        help_text=_(
            "The fastest in directions, or at heights, that no sensor watches. Raising it trusts the "
            "operator's eyes instead of a sensor."
        ),
    )
    default_share = models.FloatField(
        _("default speed share"),
        default=0.4,
        validators=_between(0.01, 1.0),
        help_text=format_lazy(
            _(
                "What part of the limits a full stick means when a page is opened, above 0 up to 1. "
                "At most {speed} m/s may come of it: everybody begins as a beginner."
            ),
            speed=f"{effective.BEGINNER_MPS:g}",
        ),
    )
    reverse_steering = models.CharField(
        _("steering in reverse"), max_length=8, choices=ReverseSteering.choices, default=ReverseSteering.TURN
    )
    drive_topic = models.CharField(
        _("drive topic"),
        max_length=200,
        validators=[_topic_name],
        help_text=_(
            "Where velocities are published. On TIAGo this chooses what wins over the console. "
            "/key_vel (priority 90) and /phone_vel (98) pass through twist_mux: the lab's own joystick and every "
            "lock, emergency_brake too, win over the browser. /joy_vel and /tab_vel (100) are not masked by "
            "the locks of priority 100: a console there ignores emergency_brake. "
            "/mobile_base_controller/cmd_vel bypasses the mux, the joystick's priority and every lock."
        ),
    )
    drive_type = models.CharField(
        _("drive type"),
        max_length=80,
        choices=[(name, name) for name in USE_TYPES["drive"]],
        default=USE_TYPES["drive"][0],
    )
    footprint = models.JSONField(
        _("footprint"),
        help_text=_(
            'Metres, base frame: {"radius_m": 0.27} or {"outline": [[0.3, 0.2], [-0.3, 0.2], ...]}, '
            "convex, with the base frame's origin inside."
        ),
    )
    topics = models.JSONField(
        _("topics"),
        help_text=_(
            "The rest of the ROS interface: odometry, scans, sonars, depth, joint_states, battery, "
            "charging, speech, languages, motions, camera, map, cancel_on_stop. Poses are [x, y, yaw] in the "
            "base frame, metres and radians. Leave out what the robot does not have."
        ),
    )
    gate = models.JSONField(
        _("gate"),
        default=dict,
        blank=True,
        help_text=_(
            "Parameters of the safety gate that differ from the values found good: lateral_margin_m, "
            "front_margin_m, hard_margin_m, deceleration_share, latency_s, creep_mps, near_miss_s. Leave {} "
            "unless you have measured."
        ),
    )
    stick = models.JSONField(
        _("stick"),
        default=default_stick,
        blank=True,
        help_text=_(
            "What a stick position passes on its way to the gate, in order; [] is nothing. Steps: scale (x, y, "
            "w), dead_zone (width), curve (exponent), one_euro (min_hz, beta, speed_hz) or mean (count, similar) to "
            "steady the hand, snap (within_deg, share) to turn on the spot while the stick is held sideways."
        ),
    )
    shipped = models.JSONField(default=dict, editable=False)  # as last taken from a data file
    shipped_phrases = models.JSONField(default=list, editable=False)  # likewise: `phrases.Line`s
    updated_at = models.DateTimeField(_("last saved"), auto_now=True)

    class Meta:
        ordering = ["name"]
        verbose_name = _("robot profile")
        verbose_name_plural = _("robot profiles")

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Check the structured parts, and what several fields only say together."""
        errors: dict[str, list[str]] = {}
        for field, check in (
            ("footprint", effective.footprint),
            ("topics", effective.profile_topics),
            ("gate", effective.profile_parameters),
            ("stick", effective.profile_stick),
        ):
            _collect(errors, field, check, self)
        if None not in (self.default_share, self.forward_mps, self.reverse_mps, self.lateral_mps):
            _collect(errors, "default_share", effective.check_profile_share, self)
        if not self.holonomic and self.lateral_mps:
            errors["lateral_mps"] = [gettext("A base that is not holonomic cannot move sideways: 0.")]
        if errors:
            raise ValidationError(errors)


class Robot(models.Model):
    """One robot: where it is, how it differs from its profile, who may use it."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    slug = models.SlugField(
        _("slug"), unique=True, help_text=_("Short name in addresses and commands, such as tiago-1.")
    )
    name = models.CharField(_("name"), max_length=80)
    profile = models.ForeignKey(
        RobotProfile, on_delete=models.PROTECT, related_name="robots", verbose_name=_("profile")
    )
    enabled = models.BooleanField(
        _("enabled"),
        default=True,
        help_text=_("Untick to take the robot out of service: it is stopped, its bridge ends within 3 s."),
    )
    practice = models.BooleanField(
        _("simulated"),
        default=False,
        help_text=_("Shown as a practice robot, so that nobody takes it for a real one."),
    )

    master_uri = models.CharField(
        _("ROS master"),
        max_length=200,
        help_text=_("ROS_MASTER_URI of the robot, such as http://tiago-42c:11311."),
    )
    advertised_address = models.CharField(
        _("advertised address"),
        max_length=200,
        blank=True,
        help_text=_(
            "What the console calls itself to this robot, so that the robot can call back: this "
            "computer's address in the robot's network, such as 10.68.0.2. Empty: this computer's host name."
        ),
    )
    host_aliases = models.JSONField(
        _("host aliases"),
        default=dict,
        blank=True,
        help_text=_(
            "Host names that the robot's nodes use and this network does not know, with addresses: "
            '{"tiago-42c": "10.68.0.1"}.'
        ),
    )
    bridge_address = models.CharField(
        _("bridge address"),
        max_length=200,
        blank=True,
        help_text=_("Empty: the bridge runs on this computer. Otherwise where it listens: wss://host:port."),
    )

    drive_topic = models.CharField(
        _("drive topic"),
        max_length=200,
        blank=True,
        validators=[_topic_name],
        help_text=_("Empty: the profile's. See there what the choice means."),
    )
    default_share = models.FloatField(
        _("default speed share"),
        null=True,
        blank=True,
        validators=_between(0.01, 1.0),
        help_text=_("Empty: the profile's."),
    )
    max_share = models.FloatField(
        _("largest speed share"),
        default=1.0,
        validators=_between(0.01, 1.0),
        help_text=_("The largest part of the limits that anybody may choose, above 0 up to 1."),
    )
    overrides = models.JSONField(
        _("overrides"),
        default=dict,
        blank=True,
        help_text=_(
            'Where this robot differs from its profile: {"topics": {}, "limits": {}, "gate": {}}. '
            "Entries of topics replace the profile's (null: this robot has no such thing); limits and gate may "
            'only tighten, such as {"limits": {"forward_mps": 0.5, "blind_mps": 0.2}}.'
        ),
    )

    stick = models.JSONField(
        _("stick"),
        null=True,
        blank=True,
        help_text=_(
            "Empty or null: the profile's steps; else all that this robot's stick passes, as described there."
        ),
    )

    fence = models.BigIntegerField("highest fencing number", default=0, editable=False)
    updated_at = models.DateTimeField(_("last saved"), auto_now=True)

    class Meta:
        ordering = ["name"]
        constraints = [
            models.UniqueConstraint(
                fields=["bridge_address"],
                condition=~models.Q(bridge_address=""),
                name="one_robot_per_bridge_address",
                violation_error_code="unique",  # said at the field
                violation_error_message=_(
                    "Another robot's bridge listens there already: each needs a host or a port of its own."
                ),
            )
        ]
        verbose_name = _("robot")
        verbose_name_plural = _("robots")

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Check addresses, aliases, and that nothing is looser than the profile."""
        errors: dict[str, list[str]] = {}
        _collect(errors, "master_uri", described.check_master_uri, self.master_uri)
        _collect(errors, "advertised_address", described.check_advertised_address, self.advertised_address)
        _collect(errors, "host_aliases", described.check_aliases, self.host_aliases)
        _collect(errors, "bridge_address", described.check_bridge_address, self.bridge_address)
        if self.profile_id is not None:
            _collect(errors, "overrides", effective.check_overrides, self)
            _collect(errors, "stick", effective.stick, self)
        if self.profile_id is not None and not errors and self.max_share is not None:
            _collect(errors, "default_share", effective.check_robot_share, self)
        if errors:
            raise ValidationError(errors)

    @cached_property
    def problems(self) -> str:
        """What keeps the entry, as it was loaded, from being driven; "" if nothing does.

        A saved entry is right, but an edit of its profile may make it wrong later.
        """
        try:
            effective.of(self)
        except described.Problems as problems:
            return str(problems)
        return ""


def _collect(errors: dict[str, list[str]], field: str, check: Callable[[T], object], value: T) -> None:
    """Run `check`; what is wrong goes to `field`."""
    try:
        check(value)
    except described.Problems as problems:
        errors.setdefault(field, []).extend(problems.lines)


class RobotRole(models.Model):
    """What one person may do with one robot."""

    robot = models.ForeignKey(Robot, on_delete=models.CASCADE, related_name="roles", verbose_name=_("robot"))
    user = models.ForeignKey(
        settings.AUTH_USER_MODEL,
        on_delete=models.CASCADE,
        related_name="robot_roles",
        verbose_name=_("person"),
    )
    role = models.CharField(
        _("role"), max_length=16, choices=[choice for choice in Role.choices if choice[0] != Role.STAFF.value]
    )

    class Meta:
        constraints = [
            models.UniqueConstraint(fields=["robot", "user"], name="one_role_per_robot_and_person")
        ]
        verbose_name = _("role on a robot")
        verbose_name_plural = _("roles on robots")

    def __str__(self) -> str:
        return gettext("%(person)s is %(role)s of %(robot)s") % {
            "person": self.user,
            "role": self.role,
            "robot": self.robot,
        }


class OfProfileOrRobot(models.Model):
    """What a whole kind of robot has, or one robot in addition."""

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
        """Whose it is."""
        owner = self.profile or self.robot
        if owner is None:
            raise ValueError(f"this {self._meta.verbose_name} belongs to no profile and to no robot")
        return owner


def check_phrase_language(code: str) -> None:
    if why := phrases.why_no_language(code):
        raise ValidationError(why)


def check_phrase_text(text: str) -> None:
    if why := phrases.why_no_phrase(text):
        raise ValidationError(why)


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
        return f"{self.language}: \u2068{self.text}\u2069"  # it runs its own way, its full stop too

    def clean(self) -> None:
        """Languages and tags in their usual form."""
        self.language = phrases.in_usual_case(self.language)
        tags = phrases.tags_in(self.tags)
        if why := phrases.why_no_tags(tags):
            raise ValidationError(why)
        self.tags = phrases.tags_text(tags)

    @property
    def line(self) -> phrases.Line:
        """As in a file."""
        return phrases.Line(self.text, self.language, phrases.tags_in(self.tags))


class Allowance(OfProfileOrRobot):
    """An entry of the allow-list: what is not there, nobody may. `robots.bridge.never` says what may not be there."""

    class What(models.TextChoices):
        """What is done with the name."""

        CHOOSE = "choose", _("choose: input goes to this topic or action")
        PUBLISH = "publish", _("publish on this topic")
        CALL = "call", _("call this service (staff only)")
        SET = "set", _("set this parameter (staff only)")

    class Use(models.TextChoices):
        """Whose input."""

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
            "Of what is chosen: which input goes there. For driving it decides what wins over the console. "
            "On TIAGo /phone_vel (priority 98) and /key_vel (90) pass through twist_mux: the lab's joystick and "
            "every lock win. /nav_vel and /servoing_cmd_vel (10, 20): every other input wins, too. /joy_vel and "
            "/tab_vel (100, not masked by emergency_brake) and a controller's own topic are refused here."
        ),
    )
    name = models.CharField(
        _("name"),
        max_length=200,
        validators=[_topic_name],
        help_text=_("Of the topic, action, service or parameter, in full."),
    )
    type = models.CharField(
        _("type"),
        max_length=120,
        blank=True,
        validators=[
            RegexValidator(
                r"^[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*$",
                _("Write package and type, such as std_msgs/String."),
            )
        ],
        help_text=_(
            "What is published or called needs it, such as std_msgs/String or std_srvs/Trigger; else leave it empty."
        ),
    )
    role = models.CharField(
        _("lowest role"),
        max_length=16,
        choices=[choice for choice in Role.choices if choice[0] != Role.OBSERVER.value],
        default=Role.OPERATOR,
        help_text=_("The lowest that may. Services and parameters are for staff, whatever is chosen here."),
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
        return f"{self.what} {self.name}"

    def clean(self) -> None:
        """Fill in what follows from the rest; refuse what no allow-list admits."""
        if self.what in (self.What.CALL, self.What.SET):
            self.role = Role.STAFF
        errors: dict[str, str] = {}
        if (self.what == self.What.CHOOSE) != bool(self.use):
            errors["use"] = (
                gettext("Say which input goes there.")
                if not self.use
                else gettext("Only for what is chosen: leave it empty.")
            )
        if self.what in self.TYPED and not self.type:
            errors["type"] = gettext("What is published or called needs its type.")
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
            told = gettext("No allow-list admits %(name)s: %(why)s.") % {"name": self.name, "why": why}
            raise ValidationError({"name": told})

    @property
    def why_nothing(self) -> str:
        """Why it counts for nothing: its owner was edited since, or no list of today's console admits it."""
        if self.what in self.TYPED and not self.type:
            return gettext("it names no type")
        topics = self._topics()
        return (topics and why_never(self.what, self.name, self.type, topics, self.use)) or ""

    def _topics(self) -> Topics | None:
        """Of its owner; of one whose own entry is wrong, nothing can be said."""
        try:
            if self.robot is not None:
                return effective.topics(self.robot)
            return effective.profile_topics(self.profile) if self.profile is not None else None
        except described.Problems:
            return None


class BridgeStatus(models.Model):
    """How a robot's bridge process fares, written by the supervisor on every change."""

    class State(models.TextChoices):
        """Life of a bridge process as its supervisor sees it."""

        STARTING = "starting", _("starting")
        RUNNING = "running", _("running")
        BACKING_OFF = "backing_off", _("ended, starts again soon")
        REFUSED = "refused", _("refused to start")
        DISABLED = "disabled", _("disabled")
        STOPPED = "stopped", _("ended with the supervisor")

    robot = models.OneToOneField(Robot, on_delete=models.CASCADE, primary_key=True, related_name="bridge")
    state = models.CharField(max_length=16, choices=State.choices)
    detail = models.CharField(max_length=500, blank=True)
    pid = models.PositiveIntegerField(null=True, blank=True)
    since = models.DateTimeField()

    class Meta:
        verbose_name_plural = "bridge statuses"

    def __str__(self) -> str:
        return f"{self.robot}: {self.state}"


class RobotMap(models.Model):
    """What a robot's map was from one time to another, as a picture. One that stays the same is one row."""

    robot = models.ForeignKey(Robot, on_delete=models.CASCADE, related_name="maps")
    digest = models.CharField(max_length=64)  # of what it shows and where
    first_seen_at = models.DateTimeField()
    last_seen_at = models.DateTimeField()
    resolution_m = models.FloatField()  # of a cell, a pixel
    origin_x_m = models.FloatField()  # lower left corner, in the map's frame
    origin_y_m = models.FloatField()
    origin_yaw = models.FloatField()
    width = models.PositiveIntegerField()  # cells
    height = models.PositiveIntegerField()
    picture = models.BinaryField()  # PNG

    class Meta:
        indexes = [models.Index(fields=["robot", "first_seen_at"], name="robots_map_of_a_time")]

    def __str__(self) -> str:
        return f"map of {self.robot} from {self.first_seen_at}"


class BridgePulse(models.Model):
    """What a robot's bridge writes to see whether it could write a record."""

    robot = models.OneToOneField(Robot, on_delete=models.CASCADE, primary_key=True, related_name="pulse")
    at = models.DateTimeField(null=True)  # of the newest one
    settled = models.BigIntegerField(default=0)  # up to this record, whatever needs an end has one

    def __str__(self) -> str:
        return f"{self.robot}: {self.at}"
