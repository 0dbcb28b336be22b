"""Profiles, robots and roles."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Collection
from typing import Any, TypeVar

import msgspec
from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import MaxValueValidator, MinValueValidator, RegexValidator
from django.db import models
from django.utils.functional import cached_property
from django.utils.text import format_lazy
from django.utils.translation import gettext, gettext_noop
from django.utils.translation import gettext_lazy as _

from fleet.base.formats.sentences import in_words
from fleet.base.names import Looks, NameField, fault_of_word, folded, require
from robots.registry.configuration import addresses, profile_schema, robot_config
from robots.shared.configuration import input_filters as stick
from robots.shared.configuration.bridge_config import TOPIC_TYPES
from robots.shared.sentences import reason_of

T = TypeVar("T")

topic_name = RegexValidator(
    r"^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$",
    _("Write a full ROS name such as /key_vel: a leading slash, then letters, digits and _."),
)


def _between(lowest: float, highest: float) -> list[MinValueValidator | MaxValueValidator]:
    return [MinValueValidator(lowest), MaxValueValidator(highest)]


class Role(models.TextChoices):
    """A person's rights on a robot, from low to high: each role includes the lower roles.

    The role of staff is not stored in a row: `User.is_staff` means staff on every robot.
    """

    OBSERVER = "observer", _("Observer: may look, and stop")
    OPERATOR = "operator", _("Operator: may drive")
    SUPERVISOR = "supervisor", _("Supervisor: may also take over control")
    STAFF = "staff", _("Staff: everything, on every robot")

    @property
    def rank(self) -> int:
        """Return the place in the order, from 0."""
        return list(Role).index(self)

    # Without these methods, Python would compare the names as strings.
    def __lt__(self, other: str) -> bool:
        return self.rank < Role(other).rank

    def __le__(self, other: str) -> bool:
        return self.rank <= Role(other).rank

    def __gt__(self, other: str) -> bool:
        return self.rank > Role(other).rank

    def __ge__(self, other: str) -> bool:
        return self.rank >= Role(other).rank


class RosChoice(models.IntegerChoices):
    """The ROS of a kind of robot."""

    ONE = 1, "ROS 1"
    TWO = 2, "ROS 2"


class Discovery(models.TextChoices):
    """How far a ROS 2 robot's nodes are searched."""

    SUBNET = "subnet", _("In this computer’s networks, by multicast")
    LOCALHOST = "localhost", _("On this computer only")
    OFF = "off", _("Not at all, only at the static peers")


class ReverseSteering(models.TextChoices):
    """Effect of moving the stick left in reverse."""

    TURN = "turn", _("Stick left always turns the robot left")
    CAR = "car", _("Like a car: mirrored in reverse")


def default_stick() -> list[dict[str, float | str]]:
    """Return the default filter steps of a profile."""
    steps: list[dict[str, float | str]] = msgspec.to_builtins(list(stick.DEFAULT))
    return steps


class RobotProfile(models.Model):
    """The common data of a kind of robot."""

    slug = models.SlugField(_("slug"), unique=True)
    name = NameField(_("name"), max_length=80)
    holonomic = models.BooleanField(
        _("holonomic"), default=False, help_text=_("The base can also move sideways.")
    )

    forward_mps = models.FloatField(
        _("forward, m/s"),
        validators=_between(0.05, 3.0),
        help_text=_("Top speed of this kind of robot."),
    )
    reverse_mps = models.FloatField(
        _("reverse, m/s"),
        validators=_between(0.0, 3.0),
        help_text=_("A positive number. TIAGo’s own limit is 0.2."),
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
        help_text=_("The base’s acceleration and braking; the gate uses a share of it."),
    )
    angular_radps2 = models.FloatField(_("angular acceleration, rad/s²"), validators=_between(0.05, 20.0))
    blind_mps = models.FloatField(
        _("blind speed, m/s"),
        validators=_between(0.01, 0.5),
        help_text=_(
            "The fastest in directions, or at heights, that no sensor watches. Raising it trusts the "
            "operator’s eyes instead of a sensor."
        ),
    )
    default_share = models.FloatField(
        _("default speed share"),
        default=0.4,
        validators=_between(0.01, 1.0),
        help_text=format_lazy(
            _(
                "The share of the limits that a full stick means when a page opens, above 0 up to 1. "
                "It may give at most {speed} m/s: everybody begins as a beginner."
            ),
            speed=f"{robot_config.BEGINNER_MPS:g}",
        ),
    )
    reverse_steering = models.CharField(
        _("steering in reverse"), max_length=8, choices=ReverseSteering.choices, default=ReverseSteering.TURN
    )
    ros = models.PositiveSmallIntegerField(
        "ROS",
        choices=RosChoice.choices,
        default=RosChoice.ONE,
        db_default=1,
        help_text=_("A robot’s form asks how it is reached there: by a master, or in a domain."),
    )
    drive_topic = models.CharField(
        _("drive topic"),
        max_length=200,
        validators=[topic_name],
        help_text=_(
            "Topic for velocities. On TIAGo this decides what wins over the console. "
            "/key_vel (priority 90) and /phone_vel (98) pass through twist_mux: the lab’s own joystick and every "
            "lock, emergency_brake too, win over the browser. /joy_vel and /tab_vel (100) are not masked by "
            "the locks of priority 100: a console there ignores emergency_brake. "
            "/mobile_base_controller/cmd_vel bypasses the mux, the joystick’s priority and every lock."
        ),
    )
    drive_type = models.CharField(
        _("drive type"),
        max_length=80,
        choices=[(name, name) for types in TOPIC_TYPES.values() for name in types["drive"]],
        default=TOPIC_TYPES[1]["drive"][0],
    )
    footprint = models.JSONField(
        _("footprint"),
        help_text=_(
            'Metres, base frame: {"radius_m": 0.27} or {"outline": [[0.3, 0.2], [-0.3, 0.2], ...]}, '
            "convex, with the base frame’s origin inside."
        ),
    )
    topics = models.JSONField(
        _("topics"),
        help_text=_(
            "The rest of the ROS interface: odometry, sensors, actions (docs/profile.md explains the keys). Poses are "
            "[x, y, yaw] in the base frame, metres and radians. Leave out what the robot does not have."
        ),
    )
    gate = models.JSONField(
        _("gate"),
        default=dict,
        blank=True,
        help_text=_(
            "Parameters of the safety gate that differ from the defaults: lateral_margin_m, "
            "front_margin_m, hard_margin_m, deceleration_share, latency_s, latency_spare_s, operator_delay_s, "
            "creep_mps, near_miss_s, between_sonars_mps. Leave {} unless you have measured."
        ),
    )
    stick = models.JSONField(
        _("stick"),
        default=default_stick,
        blank=True,
        help_text=_(
            "Filter steps between stick and gate, in order; [] means none. Steps: scale (x, y, "
            "w), dead_zone (width), curve (exponent), one_euro (min_hz, beta, speed_hz) or mean (count, similar) to "
            "reduce tremor, snap (within_deg, share) to turn on the spot while the stick is held sideways."
        ),
    )
    shipped = models.JSONField(default=dict, editable=False)  # the data file's content at the last load
    shipped_phrases = models.JSONField(default=list, editable=False)  # `phrases.Line`s at the last load
    updated_at = models.DateTimeField(_("last saved"), auto_now=True)

    class Meta:
        ordering = ["name"]
        verbose_name = _("robot profile")
        verbose_name_plural = _("robot profiles")

    def __str__(self) -> str:
        return self.name

    @property
    def kind(self) -> str:
        """Return the name without its ROS: pages show that beside the name of the robot."""
        return self.name.removesuffix(f" ({self.get_ros_display()})")

    def clean(self) -> None:
        """Raise `ValidationError` if a structured part is wrong, or fields do not fit together."""
        errors: dict[str, list[str]] = {}
        for field, check in (
            ("footprint", robot_config.footprint),
            ("topics", robot_config.profile_topics),
            ("gate", robot_config.profile_parameters),
            ("stick", robot_config.profile_stick),
        ):
            _collect(errors, field, check, self)
        if None not in (self.default_share, self.forward_mps, self.reverse_mps, self.lateral_mps):
            _collect(errors, "default_share", robot_config.check_profile_share, self)
        if not self.holonomic and self.lateral_mps:
            errors["lateral_mps"] = [gettext("A base that is not holonomic cannot move sideways: 0.")]
        if errors:
            raise ValidationError(errors)


# The fields by which a robot is reached, by its ROS, with their checks
_REACHED: dict[int, dict[str, Callable[[Any], object]]] = {
    RosChoice.ONE: {
        "master_uri": addresses.check_master_uri,
        "advertised_address": addresses.check_advertised_address,
        "host_aliases": addresses.check_aliases,
    },
    RosChoice.TWO: {
        "static_peers": addresses.check_peers,
        "discovery_server": addresses.check_discovery_server,
        "namespace": addresses.check_namespace,
        "ros_setup": addresses.check_setup,
    },
}
_SEARCHED = ("discovery", "static_peers", "discovery_server", "namespace")
_TWIN = gettext_noop(
    "%(robot)s is in this domain already: give one of the two another domain or a namespace."
)
_ALIKE = _("This name looks the same as that of another robot: choose another one.")


class Robot(models.Model):
    """One robot: its address, and its differences from its profile."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    slug = models.SlugField(
        _("slug"), unique=True, help_text=_("Short name in addresses and commands, such as tiago-1.")
    )
    name = NameField(_("name"), max_length=80)
    profile = models.ForeignKey(
        RobotProfile, on_delete=models.PROTECT, related_name="robots", verbose_name=_("profile")
    )
    room = NameField(
        _("room"),
        max_length=120,
        blank=True,
        default="",
        db_default="",
        help_text=_("Where people find the robot, such as Lab 2.13: letters and calendars say it."),
    )
    enabled = models.BooleanField(
        _("enabled"),
        default=True,
        help_text=_("Untick to take the robot out of service: it is stopped, its bridge ends within 3 s."),
    )
    practice = models.BooleanField(
        _("simulated"),
        default=False,
        help_text=_("The pages mark it as simulated, so that nobody mistakes it for a real robot."),
    )

    # How a robot with ROS 1 is reached; if its profile has ROS 2, this is not used.
    master_uri = models.CharField(
        _("ROS master"),
        max_length=200,
        blank=True,
        help_text=_("ROS_MASTER_URI of the robot, such as http://tiago-42c:11311."),
    )
    advertised_address = models.CharField(
        _("advertised address"),
        max_length=200,
        blank=True,
        help_text=_(
            "The address under which the robot calls the console back: this "
            "computer’s address in the robot’s network, such as 10.68.0.2. Empty: this computer’s host name."
        ),
    )
    host_aliases = models.JSONField(
        _("host aliases"),
        default=dict,
        blank=True,
        help_text=_(
            "Host names that the robot’s nodes use and this network does not know, with addresses: "
            '{"tiago-42c": "10.68.0.1"}.'
        ),
    )
    # How a robot with ROS 2 is reached
    domain_id = models.PositiveSmallIntegerField(
        _("domain"),
        default=0,
        db_default=0,
        validators=_between(0, 101),
        help_text=_("ROS_DOMAIN_ID of the robot, 0 to 101."),
    )
    discovery = models.CharField(
        _("search for the robot"),
        max_length=10,
        choices=Discovery.choices,
        default=Discovery.SUBNET,
        db_default="subnet",
        help_text=_("Unused with a discovery server."),
    )
    static_peers = models.CharField(
        _("static peers"),
        max_length=400,
        blank=True,
        default="",
        db_default="",
        help_text=_(
            "Addresses of the robot’s computers, with spaces between them, if multicast does not reach them: "
            "10.68.0.1 tiago-42c."
        ),
    )
    discovery_server = models.CharField(
        _("discovery server"),
        max_length=200,
        blank=True,
        default="",
        db_default="",
        help_text=_("host:port of the robot’s discovery server, if it has one: 10.68.0.1:11811."),
    )
    namespace = models.CharField(
        _("namespace"),
        max_length=100,
        blank=True,
        default="",
        db_default="",
        help_text=_("Stands before all of the robot’s names, if several robots share a domain: /tiago1."),
    )
    ros_setup = models.CharField(
        _("set-up script of ROS"),
        max_length=300,
        blank=True,
        default="",
        db_default="",
        help_text=_(
            "Of the distribution on the bridge’s computer whose rclpy and messages are used, such as "
            "/opt/ros/jazzy/setup.bash. Empty: the console’s own packages."
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
        validators=[topic_name],
        help_text=_("Empty: the profile’s choice. The profile explains it."),
    )
    default_share = models.FloatField(
        _("default speed share"),
        null=True,
        blank=True,
        validators=_between(0.01, 1.0),
        help_text=_("Empty: the profile’s."),
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
            "Entries of topics replace the profile’s (null: this robot does not have it); limits and gate may "
            'only tighten, such as {"limits": {"forward_mps": 0.5, "blind_mps": 0.2}}.'
        ),
    )

    stick = models.JSONField(
        _("stick"),
        null=True,
        blank=True,
        help_text=_(
            "Empty or null: the profile’s steps. Otherwise all filter steps of this robot, as described there."
        ),
    )

    deleted_by: Any = None  # the person who deletes this robot next; None: the command line
    fence = models.BigIntegerField("highest fence", default=0, editable=False)
    updated_at = models.DateTimeField(_("last saved"), auto_now=True)

    class Meta:
        ordering = ["name"]
        constraints = [
            models.UniqueConstraint(
                fields=["bridge_address"],
                condition=~models.Q(bridge_address=""),
                name="one_robot_per_bridge_address",
                violation_error_code="unique",  # shown at the field
                violation_error_message=_(
                    "Another robot’s bridge listens there already: each needs a host or a port of its own."
                ),
            )
        ]
        verbose_name = _("robot")
        verbose_name_plural = _("robots")

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Raise `ValidationError`: a name, address or alias is wrong, or an entry is less strict than the profile."""
        self._check_names()
        errors: dict[str, list[str]] = {}
        _collect(errors, "bridge_address", addresses.check_bridge_address, self.bridge_address)
        if self.profile_id is not None:
            for field, check in _REACHED[self.profile.ros].items():
                _collect(errors, field, check, getattr(self, field))
            if twin := self._twin():
                errors["domain_id"] = [gettext(_TWIN) % {"robot": twin}]
        if self.profile_id is not None:
            _collect(errors, "overrides", robot_config.check_overrides, self)
            _collect(errors, "stick", robot_config.stick, self)
        if self.profile_id is not None and not errors and self.max_share is not None:
            _collect(errors, "default_share", robot_config.check_robot_share, self)
        if errors:
            raise ValidationError(errors)

    def _check_names(self) -> None:
        """Refuse a new name that people would mistake for that of another robot: robots have no namesakes."""
        others = dict(Robot.objects.values_list("pk", "name"))
        if others.pop(self.pk, None) != self.name and _is_alike(self.name, others.values()):
            raise ValidationError({"name": ValidationError(_ALIKE, code="name_alike")})
        if self._state.adding:
            require(self.slug, fault_of_word)

    def _twin(self) -> Robot | None:
        """Return another robot with ROS 2 whose topics would be the same: a twist for one would move both."""
        if not self.enabled or self.profile.ros != RosChoice.TWO:
            return None
        same = {name: getattr(self, name) for name in ("enabled", "bridge_address", "domain_id", *_SEARCHED)}
        others = Robot.objects.filter(profile__ros=RosChoice.TWO, **same)
        return others.exclude(pk=self.pk).first()

    @cached_property
    def problems(self) -> str:
        """Return why this robot cannot be driven: a fault of its entry as loaded. "" if there is none.

        A saved entry is valid, but a later edit of the profile may make it wrong.
        """
        try:
            robot_config.of(self)
        except profile_schema.Problems as problems:
            return reason_of(problems)
        return ""


def _is_alike(name: str, others: Collection[str]) -> bool:
    return folded(name) in map(folded, others) or Looks(others).alike(name)


def _collect(errors: dict[str, list[str]], field: str, check: Callable[[T], object], value: T) -> None:
    """Run `check`; add its faults to `errors` at `field`."""
    try:
        check(value)
    except profile_schema.Problems as problems:
        errors.setdefault(field, []).extend(map(in_words, problems.lines))


class RobotRole(models.Model):
    """The role of one person on one robot."""

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
            "role": gettext(self.role),
            "robot": self.robot,
        }
