"""A robot has several cameras: `camera` of a profile's or robot's topics becomes the first entry of `cameras`."""

from typing import Any

from django.db import migrations, models
from django.db.backends.base.schema import BaseDatabaseSchemaEditor
from django.db.migrations.state import StateApps


def several(topics: Any) -> bool:
    """Replace the entry in `topics`. Return whether there was one."""
    if not isinstance(topics, dict) or "camera" not in topics:
        return False
    camera = topics.pop("camera")
    if isinstance(camera, dict) and "cameras" not in topics:
        topics["cameras"] = [{"name": "camera", "topic": camera.get("name"), "type": camera.get("type")}]
    elif camera is None:
        topics["cameras"] = []
    return True


def move(apps: StateApps, _editor: BaseDatabaseSchemaEditor) -> None:
    for profile in apps.get_model("robots", "RobotProfile").objects.all():
        shipped = profile.shipped if isinstance(profile.shipped, dict) else {}
        if several(profile.topics) | several(shipped.get("topics")):
            profile.save(update_fields=["topics", "shipped"])
    for robot in apps.get_model("robots", "Robot").objects.all():
        if isinstance(robot.overrides, dict) and several(robot.overrides.get("topics")):
            robot.save(update_fields=["overrides"])


class Migration(migrations.Migration):
    dependencies = [("robots", "0001_squashed")]

    operations = [
        migrations.RunPython(move, migrations.RunPython.noop),
        migrations.AlterField(
            model_name="robotprofile",
            name="topics",
            field=models.JSONField(
                help_text="The rest of the ROS interface: odometry, scans, sonars, depth, head, arm, joint_states, battery, charging, diagnostics, speech, languages, motions, cameras, map, navigation, gripper, torso, cancel_on_stop. Poses are [x, y, yaw] in the base frame, metres and radians. Leave out what the robot does not have.",
                verbose_name="topics",
            ),
        ),
    ]
