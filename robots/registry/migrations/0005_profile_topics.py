from django.db import migrations, models

_HELP = "The rest of the ROS interface: odometry, sensors, actions (docs/profile.md explains the keys). Poses are [x, y, yaw] in the base frame, metres and radians. Leave out what the robot does not have."


class Migration(migrations.Migration):
    dependencies = [("robots", "0004_plain_texts")]
    operations = [
        migrations.AlterField("robotprofile", "topics", models.JSONField("topics", help_text=_HELP)),
    ]
