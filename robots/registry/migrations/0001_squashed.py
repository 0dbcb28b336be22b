import django.core.validators
import django.db.models.deletion
import robots.registry.models
import uuid
from django.conf import settings
from django.db import migrations, models


class Migration(migrations.Migration):
    initial = True

    replaces = [
        ("robots", "0001_initial"),
        ("robots", "0002_shipped_content"),
        ("robots", "0003_stick"),
        ("robots", "0004_phrases_and_allowances"),
        ("robots", "0005_words"),
        ("robots", "0006_pulse"),
        ("robots", "0007_map"),
        ("robots", "0008_bridge_addresses"),
        ("robots", "0009_typed_calls"),
        ("robots", "0010_help"),
        ("robots", "0011_apostrophes"),
        ("robots", "0012_latency_spare"),
        ("robots", "0013_between_sonars"),
    ]

    dependencies = [
        migrations.swappable_dependency(settings.AUTH_USER_MODEL),
    ]

    operations = [
        migrations.CreateModel(
            name="Robot",
            fields=[
                ("id", models.UUIDField(default=uuid.uuid4, editable=False, primary_key=True, serialize=False)),
                ("slug", models.SlugField(help_text="Short name in addresses and commands, such as tiago-1.", unique=True, verbose_name="slug")),
                ("name", models.CharField(max_length=80, verbose_name="name")),
                ("enabled", models.BooleanField(default=True, help_text="Untick to take the robot out of service: it is stopped, its bridge ends within 3 s.", verbose_name="enabled")),
                ("practice", models.BooleanField(default=False, help_text="The pages mark it as simulated, so that nobody mistakes it for a real robot.", verbose_name="simulated")),
                ("master_uri", models.CharField(help_text="ROS_MASTER_URI of the robot, such as http://tiago-42c:11311.", max_length=200, verbose_name="ROS master")),
                ("advertised_address", models.CharField(blank=True, help_text="The address under which the robot calls the console back: this computer’s address in the robot’s network, such as 10.68.0.2. Empty: this computer’s host name.", max_length=200, verbose_name="advertised address")),
                ("host_aliases", models.JSONField(blank=True, default=dict, help_text='Host names that the robot’s nodes use and this network does not know, with addresses: {"tiago-42c": "10.68.0.1"}.', verbose_name="host aliases")),
                ("bridge_address", models.CharField(blank=True, help_text="Empty: the bridge runs on this computer. Otherwise where it listens: wss://host:port.", max_length=200, verbose_name="bridge address")),
                (
                    "drive_topic",
                    models.CharField(
                        blank=True,
                        help_text="Empty: the profile’s choice. The profile explains it.",
                        max_length=200,
                        validators=[django.core.validators.RegexValidator("^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$", "Write a full ROS name such as /key_vel: a leading slash, then letters, digits and _.")],
                        verbose_name="drive topic",
                    ),
                ),
                ("default_share", models.FloatField(blank=True, help_text="Empty: the profile’s.", null=True, validators=[django.core.validators.MinValueValidator(0.01), django.core.validators.MaxValueValidator(1.0)], verbose_name="default speed share")),
                ("max_share", models.FloatField(default=1.0, help_text="The largest part of the limits that anybody may choose, above 0 up to 1.", validators=[django.core.validators.MinValueValidator(0.01), django.core.validators.MaxValueValidator(1.0)], verbose_name="largest speed share")),
                (
                    "overrides",
                    models.JSONField(
                        blank=True,
                        default=dict,
                        help_text='Where this robot differs from its profile: {"topics": {}, "limits": {}, "gate": {}}. Entries of topics replace the profile’s (null: this robot does not have it); limits and gate may only tighten, such as {"limits": {"forward_mps": 0.5, "blind_mps": 0.2}}.',
                        verbose_name="overrides",
                    ),
                ),
                ("stick", models.JSONField(blank=True, help_text="Empty or null: the profile’s steps. Otherwise all filter steps of this robot, as described there.", null=True, verbose_name="stick")),
                ("fence", models.BigIntegerField(default=0, editable=False, verbose_name="highest fencing number")),
                ("updated_at", models.DateTimeField(auto_now=True, verbose_name="last saved")),
            ],
            options={
                "verbose_name": "robot",
                "verbose_name_plural": "robots",
                "ordering": ["name"],
            },
        ),
        migrations.CreateModel(
            name="RobotProfile",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("slug", models.SlugField(unique=True, verbose_name="slug")),
                ("name", models.CharField(max_length=80, verbose_name="name")),
                ("holonomic", models.BooleanField(default=False, help_text="The base can also move sideways.", verbose_name="holonomic")),
                ("forward_mps", models.FloatField(help_text="The fastest that this kind of robot goes.", validators=[django.core.validators.MinValueValidator(0.05), django.core.validators.MaxValueValidator(3.0)], verbose_name="forward, m/s")),
                ("reverse_mps", models.FloatField(help_text="A positive number. TIAGo’s own limit is 0.2.", validators=[django.core.validators.MinValueValidator(0.0), django.core.validators.MaxValueValidator(3.0)], verbose_name="reverse, m/s")),
                ("lateral_mps", models.FloatField(default=0.0, help_text="0 unless the base is holonomic.", validators=[django.core.validators.MinValueValidator(0.0), django.core.validators.MaxValueValidator(3.0)], verbose_name="sideways, m/s")),
                ("turn_radps", models.FloatField(validators=[django.core.validators.MinValueValidator(0.05), django.core.validators.MaxValueValidator(6.3)], verbose_name="turning, rad/s")),
                ("linear_mps2", models.FloatField(help_text="The base’s acceleration and braking; the gate uses a share of it.", validators=[django.core.validators.MinValueValidator(0.05), django.core.validators.MaxValueValidator(10.0)], verbose_name="acceleration, m/s²")),
                ("angular_radps2", models.FloatField(validators=[django.core.validators.MinValueValidator(0.05), django.core.validators.MaxValueValidator(20.0)], verbose_name="angular acceleration, rad/s²")),
                (
                    "blind_mps",
                    models.FloatField(help_text="The fastest in directions, or at heights, that no sensor watches. Raising it trusts the operator’s eyes instead of a sensor.", validators=[django.core.validators.MinValueValidator(0.01), django.core.validators.MaxValueValidator(0.5)], verbose_name="blind speed, m/s"),
                ),
                (
                    "default_share",
                    models.FloatField(
                        default=0.4,
                        help_text="The share of the limits that a full stick means when a page opens, above 0 up to 1. It may give at most 0.4 m/s: everybody begins as a beginner.",
                        validators=[django.core.validators.MinValueValidator(0.01), django.core.validators.MaxValueValidator(1.0)],
                        verbose_name="default speed share",
                    ),
                ),
                ("reverse_steering", models.CharField(choices=[("turn", "Stick left always turns the robot left"), ("car", "Like a car: mirrored in reverse")], default="turn", max_length=8, verbose_name="steering in reverse")),
                (
                    "drive_topic",
                    models.CharField(
                        help_text="Topic for velocities. On TIAGo this decides what wins over the console. /key_vel (priority 90) and /phone_vel (98) pass through twist_mux: the lab’s own joystick and every lock, emergency_brake too, win over the browser. /joy_vel and /tab_vel (100) are not masked by the locks of priority 100: a console there ignores emergency_brake. /mobile_base_controller/cmd_vel bypasses the mux, the joystick’s priority and every lock.",
                        max_length=200,
                        validators=[django.core.validators.RegexValidator("^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$", "Write a full ROS name such as /key_vel: a leading slash, then letters, digits and _.")],
                        verbose_name="drive topic",
                    ),
                ),
                ("drive_type", models.CharField(choices=[("geometry_msgs/Twist", "geometry_msgs/Twist"), ("geometry_msgs/TwistStamped", "geometry_msgs/TwistStamped")], default="geometry_msgs/Twist", max_length=80, verbose_name="drive type")),
                ("footprint", models.JSONField(help_text='Metres, base frame: {"radius_m": 0.27} or {"outline": [[0.3, 0.2], [-0.3, 0.2], ...]}, convex, with the base frame’s origin inside.', verbose_name="footprint")),
                (
                    "topics",
                    models.JSONField(
                        help_text="The rest of the ROS interface: odometry, scans, sonars, depth, head, arm, joint_states, battery, charging, speech, languages, motions, camera, map, cancel_on_stop. Poses are [x, y, yaw] in the base frame, metres and radians. Leave out what the robot does not have.",
                        verbose_name="topics",
                    ),
                ),
                (
                    "gate",
                    models.JSONField(
                        blank=True,
                        default=dict,
                        help_text="Parameters of the safety gate that differ from the defaults: lateral_margin_m, front_margin_m, hard_margin_m, deceleration_share, latency_s, latency_spare_s, operator_delay_s, creep_mps, near_miss_s, between_sonars_mps. Leave {} unless you have measured.",
                        verbose_name="gate",
                    ),
                ),
                (
                    "stick",
                    models.JSONField(
                        blank=True,
                        default=robots.registry.models.default_stick,
                        help_text="Filter steps between stick and gate, in order; [] means none. Steps: scale (x, y, w), dead_zone (width), curve (exponent), one_euro (min_hz, beta, speed_hz) or mean (count, similar) to reduce tremor, snap (within_deg, share) to turn on the spot while the stick is held sideways.",
                        verbose_name="stick",
                    ),
                ),
                ("shipped", models.JSONField(default=dict, editable=False)),
                ("shipped_phrases", models.JSONField(default=list, editable=False)),
                ("updated_at", models.DateTimeField(auto_now=True, verbose_name="last saved")),
            ],
            options={
                "verbose_name": "robot profile",
                "verbose_name_plural": "robot profiles",
                "ordering": ["name"],
            },
        ),
        migrations.CreateModel(
            name="BridgePulse",
            fields=[
                ("robot", models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name="pulse", serialize=False, to="robots.robot")),
                ("at", models.DateTimeField(null=True)),
                ("settled", models.BigIntegerField(default=0)),
            ],
        ),
        migrations.CreateModel(
            name="BridgeStatus",
            fields=[
                ("robot", models.OneToOneField(on_delete=django.db.models.deletion.CASCADE, primary_key=True, related_name="bridge", serialize=False, to="robots.robot")),
                ("state", models.CharField(choices=[("starting", "starting"), ("running", "running"), ("backing_off", "ended, starts again soon"), ("refused", "refused to start"), ("disabled", "disabled"), ("stopped", "ended with the supervisor")], max_length=16)),
                ("detail", models.CharField(blank=True, max_length=500)),
                ("pid", models.PositiveIntegerField(blank=True, null=True)),
                ("since", models.DateTimeField()),
            ],
            options={
                "verbose_name_plural": "bridge statuses",
            },
        ),
        migrations.AddField(
            model_name="robot",
            name="profile",
            field=models.ForeignKey(on_delete=django.db.models.deletion.PROTECT, related_name="robots", to="robots.robotprofile", verbose_name="profile"),
        ),
        migrations.CreateModel(
            name="Phrase",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("text", models.TextField(help_text="One line, at most 500 characters, in its own script.", validators=[robots.registry.models.check_phrase_text], verbose_name="text")),
                ("language", models.CharField(help_text="Such as en-GB (BCP 47).", max_length=35, validators=[robots.registry.models.check_phrase_language], verbose_name="language")),
                ("order", models.PositiveIntegerField(default=0, help_text="Small numbers come first.", verbose_name="order")),
                ("tags", models.CharField(blank=True, help_text="Words to find it by, separated by commas.", max_length=200, verbose_name="tags")),
                ("robot", models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name="%(class)ss", to="robots.robot", verbose_name="robot")),
                ("profile", models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name="%(class)ss", to="robots.robotprofile", verbose_name="profile")),
            ],
            options={
                "verbose_name": "phrase",
                "verbose_name_plural": "phrases",
                "ordering": ["order", "id"],
                "abstract": False,
            },
        ),
        migrations.CreateModel(
            name="Allowance",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("what", models.CharField(choices=[("choose", "choose: input goes to this topic or action"), ("publish", "publish on this topic"), ("call", "call this service (staff only)"), ("set", "set this parameter (staff only)")], max_length=8, verbose_name="what")),
                (
                    "use",
                    models.CharField(
                        blank=True,
                        choices=[("drive", "driving"), ("speech", "speech"), ("motions", "motions")],
                        help_text="For *choose*: the input that goes there. For driving it decides what wins over the console. On TIAGo /phone_vel (priority 98) and /key_vel (90) pass through twist_mux: the lab’s joystick and every lock win. /nav_vel and /servoing_cmd_vel (10, 20): every other input wins, too. /joy_vel and /tab_vel (100, not masked by emergency_brake) and a controller’s own topic are refused here.",
                        max_length=8,
                        verbose_name="input",
                    ),
                ),
                (
                    "name",
                    models.CharField(
                        help_text="Full name of the topic, action, service or parameter.", max_length=200, validators=[django.core.validators.RegexValidator("^/[A-Za-z][A-Za-z0-9_]*(/[A-Za-z0-9_]+)*$", "Write a full ROS name such as /key_vel: a leading slash, then letters, digits and _.")], verbose_name="name"
                    ),
                ),
                (
                    "type",
                    models.CharField(
                        blank=True,
                        help_text="Needed for publish and call, such as std_msgs/String or std_srvs/Trigger; otherwise leave it empty.",
                        max_length=120,
                        validators=[django.core.validators.RegexValidator("^[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*$", "Write package and type, such as std_msgs/String.")],
                        verbose_name="type",
                    ),
                ),
                (
                    "role",
                    models.CharField(
                        choices=[("operator", "Operator: may drive"), ("supervisor", "Supervisor: may also take over control"), ("staff", "Staff: everything, on every robot")],
                        default="operator",
                        help_text="The lowest role that may use it. Services and parameters are always for staff only.",
                        max_length=16,
                        verbose_name="lowest role",
                    ),
                ),
                ("robot", models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name="%(class)ss", to="robots.robot", verbose_name="robot")),
                ("profile", models.ForeignKey(blank=True, null=True, on_delete=django.db.models.deletion.CASCADE, related_name="%(class)ss", to="robots.robotprofile", verbose_name="profile")),
            ],
            options={
                "verbose_name": "allow-list entry",
                "verbose_name_plural": "allow-list entries",
                "ordering": ["what", "use", "name"],
                "abstract": False,
            },
        ),
        migrations.CreateModel(
            name="RobotRole",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("role", models.CharField(choices=[("observer", "Observer: may look, and stop"), ("operator", "Operator: may drive"), ("supervisor", "Supervisor: may also take over control")], max_length=16, verbose_name="role")),
                ("robot", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="roles", to="robots.robot", verbose_name="robot")),
                ("user", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="robot_roles", to=settings.AUTH_USER_MODEL, verbose_name="person")),
            ],
            options={
                "verbose_name": "role on a robot",
                "verbose_name_plural": "roles on robots",
            },
        ),
        migrations.CreateModel(
            name="RobotMap",
            fields=[
                ("id", models.BigAutoField(auto_created=True, primary_key=True, serialize=False, verbose_name="ID")),
                ("digest", models.CharField(max_length=64)),
                ("first_seen_at", models.DateTimeField()),
                ("last_seen_at", models.DateTimeField()),
                ("resolution_m", models.FloatField()),
                ("origin_x_m", models.FloatField()),
                ("origin_y_m", models.FloatField()),
                ("origin_yaw", models.FloatField()),
                ("width", models.PositiveIntegerField()),
                ("height", models.PositiveIntegerField()),
                ("picture", models.BinaryField()),
                ("robot", models.ForeignKey(on_delete=django.db.models.deletion.CASCADE, related_name="maps", to="robots.robot")),
            ],
            options={
                "indexes": [models.Index(fields=["robot", "first_seen_at"], name="robots_map_of_a_time")],
            },
        ),
        migrations.AddConstraint(
            model_name="robot",
            constraint=models.UniqueConstraint(condition=models.Q(("bridge_address", ""), _negated=True), fields=("bridge_address",), name="one_robot_per_bridge_address", violation_error_code="unique", violation_error_message="Another robot’s bridge listens there already: each needs a host or a port of its own."),
        ),
        migrations.AddConstraint(
            model_name="phrase",
            constraint=models.CheckConstraint(condition=models.Q(("profile__isnull", False), ("robot__isnull", False), _connector="XOR"), name="phrase_of_profile_or_robot", violation_error_message="Name either a profile or a robot."),
        ),
        migrations.AddConstraint(
            model_name="allowance",
            constraint=models.CheckConstraint(condition=models.Q(("profile__isnull", False), ("robot__isnull", False), _connector="XOR"), name="allowance_of_profile_or_robot", violation_error_message="Name either a profile or a robot."),
        ),
        migrations.AddConstraint(
            model_name="allowance",
            constraint=models.UniqueConstraint(fields=("profile", "what", "use", "name"), name="one_allowance_per_profile_and_name"),
        ),
        migrations.AddConstraint(
            model_name="allowance",
            constraint=models.UniqueConstraint(fields=("robot", "what", "use", "name"), name="one_allowance_per_robot_and_name"),
        ),
        migrations.AddConstraint(
            model_name="robotrole",
            constraint=models.UniqueConstraint(fields=("robot", "user"), name="one_role_per_robot_and_person"),
        ),
    ]
