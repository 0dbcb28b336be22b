"""The fields of a robot's form by which it is reached: those of its profile's ROS, and no others."""

from __future__ import annotations

from typing import Any, cast

from django.forms import Form
from django.forms.utils import ErrorDict
from django.http import HttpRequest, QueryDict

from robots.registry.models import Robot, RobotProfile, RosChoice

# Sent by static/js/lib/reached_fields.js after the choice of a profile with the other ROS: show its fields only
ASKS_AGAIN = "_reached"
FIRST = {RosChoice.ONE: ["master_uri"], RosChoice.TWO: ["domain_id", "discovery"]}
OTHERS = {
    RosChoice.ONE: ["advertised_address", "host_aliases"],
    RosChoice.TWO: ["static_peers", "discovery_server", "namespace", "ros_setup"],
}


def ros_of(request: HttpRequest, robot: Robot | None) -> RosChoice:
    """Return the ROS of the profile that is chosen in the form, or else of the robot's own."""
    chosen = request.POST.get("profile") or request.GET.get("profile") or ""
    key = int(chosen) if chosen.isascii() and chosen.isdigit() else robot.profile_id if robot else None
    profile = RobotProfile.objects.filter(pk=key).first() if key is not None else None
    return RosChoice(profile.ros) if profile else RosChoice.ONE


class ReachedFields(Form):
    """Form of a robot that shows the other fields when a profile with the other ROS is chosen."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if "profile" in self.fields:
            others = RobotProfile.objects.filter(ros=RosChoice.TWO).values_list("pk", flat=True)
            widget: Any = self.fields["profile"].widget
            select = getattr(widget, "widget", widget)  # within the links of the admin
            select.attrs["data-ros2"] = " ".join(map(str, sorted(others)))
        if self.asks_again:
            self.data = data = cast(QueryDict, self.data).copy()
            for name, field in self.fields.items():
                if self.add_prefix(name) not in data and field.initial is not None:
                    data[self.add_prefix(name)] = field.initial

    @property
    def asks_again(self) -> bool:
        """Whether the form is only shown again."""
        return ASKS_AGAIN in self.data

    def full_clean(self) -> None:
        """Find no faults in a form that is only shown again: nobody has filled it in yet."""
        super().full_clean()
        if self.asks_again:
            self._errors = ErrorDict()

    def is_valid(self) -> bool:
        return not self.asks_again and super().is_valid()
