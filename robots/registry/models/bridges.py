"""Data that the console's processes write about a robot: status of its bridge, its maps and its description."""

from __future__ import annotations

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.translation import gettext_lazy as _

from fleet.base.formats.sentences import in_words
from robots.registry.configuration import addresses
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models.registry import Robot

FIRST_PORT = 7443  # of a bridge on another computer; the next robot there has the next port


class BridgeStatus(models.Model):
    """State of a robot's bridge process. The fleet supervisor writes it on every change."""

    class State(models.TextChoices):
        """State of a bridge process, by its fleet supervisor."""

        STARTING = "starting", _("starting")
        RUNNING = "running", _("running")
        BACKING_OFF = "backing_off", _("ended, starts again soon")
        REFUSED = "refused", _("refused to start")
        DISABLED = "disabled", _("disabled")
        STOPPED = "stopped", _("ended with the supervisor")

    robot = models.OneToOneField(Robot, on_delete=models.CASCADE, primary_key=True, related_name="bridge")
    state = models.CharField(max_length=16, choices=State.choices)
    detail = models.CharField(max_length=500, blank=True)
    said = models.JSONField(default=list, blank=True)  # key and figures of `detail`; empty: it has none
    pid = models.PositiveIntegerField(null=True, blank=True)
    host = models.CharField(max_length=64, blank=True, default="", db_default="")  # the supervisor's computer
    since = models.DateTimeField()

    class Meta:
        verbose_name_plural = "bridge statuses"

    def __str__(self) -> str:
        return f"{self.robot}: {self.state}"


class RobotMap(models.Model):
    """A robot's map in a period, as a picture. While the map does not change, it is one row."""

    robot = models.ForeignKey(Robot, on_delete=models.CASCADE, related_name="maps")
    digest = models.CharField(max_length=64)  # hash of content and origin
    first_seen_at = models.DateTimeField()
    last_seen_at = models.DateTimeField()
    resolution_m = models.FloatField()  # size of a cell, which is one pixel
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


class RobotDescription(models.Model):
    """The newest description (URDF) of a robot, from which pages draw the robot."""

    robot = models.OneToOneField(
        Robot, on_delete=models.CASCADE, primary_key=True, related_name="description"
    )
    digest = models.CharField(max_length=64)  # hash of the text
    seen_at = models.DateTimeField()
    packed = models.BinaryField()  # the text, compressed by zlib
    problem = models.CharField(max_length=200, blank=True)  # why there is no usable description

    def __str__(self) -> str:
        return f"description of {self.robot} from {self.seen_at}"


class BridgePulse(models.Model):
    """A row that a bridge writes to test whether it can write a record."""

    robot = models.OneToOneField(Robot, on_delete=models.CASCADE, primary_key=True, related_name="pulse")
    at = models.DateTimeField(null=True)  # time of the newest test
    settled = models.BigIntegerField(default=0)  # key of a record: all starts up to it have their ends

    def __str__(self) -> str:
        return f"{self.robot}: {self.at}"


class BridgeHost(models.Model):
    """Another computer that runs bridges. It joins with a code that works once and for a short time."""

    name = models.CharField(
        _("name or address"),
        max_length=200,
        unique=True,
        help_text=_("Under which this console reaches the computer, such as arm.lab.example or 10.68.0.3."),
    )
    code_digest = models.CharField(max_length=64, blank=True, editable=False)  # blank: no code is open
    code_until = models.DateTimeField(null=True, editable=False)
    joined_at = models.DateTimeField(_("joined"), null=True, editable=False)
    certificate_until = models.DateTimeField(_("certificate until"), null=True, editable=False)

    class Meta:
        ordering = ["name"]
        verbose_name = _("bridge host")
        verbose_name_plural = _("bridge hosts")

    def __str__(self) -> str:
        return self.name

    def clean(self) -> None:
        """Raise `ValidationError` if no bridge address can have this host."""
        self.name = self.name.lower()
        try:
            addresses.check_bridge_address(f"wss://{self.name}:{FIRST_PORT}")
        except Problems as problems:
            raise ValidationError({"name": [*map(in_words, problems.lines)]}) from problems
