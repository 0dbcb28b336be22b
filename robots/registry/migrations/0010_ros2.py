import django.core.validators
from django.db import migrations, models


class Migration(migrations.Migration):

    dependencies = [
        ('robots', '0009_bridge_host'),
    ]

    operations = [
        migrations.AddField(
            model_name='robot',
            name='discovery',
            field=models.CharField(choices=[('subnet', 'In this computer’s networks, by multicast'), ('localhost', 'On this computer only'), ('off', 'Not at all, only at the static peers')], db_default='subnet', default='subnet', help_text='Unused with a discovery server.', max_length=10, verbose_name='search for the robot'),
        ),
        migrations.AddField(
            model_name='robot',
            name='discovery_server',
            field=models.CharField(blank=True, db_default='', default='', help_text='host:port of the robot’s discovery server, if it has one: 10.68.0.1:11811.', max_length=200, verbose_name='discovery server'),
        ),
        migrations.AddField(
            model_name='robot',
            name='domain_id',
            field=models.PositiveSmallIntegerField(db_default=0, default=0, help_text='ROS_DOMAIN_ID of the robot, 0 to 101.', validators=[django.core.validators.MinValueValidator(0), django.core.validators.MaxValueValidator(101)], verbose_name='domain'),
        ),
        migrations.AddField(
            model_name='robot',
            name='namespace',
            field=models.CharField(blank=True, db_default='', default='', help_text='Stands before all of the robot’s names, if several robots share a domain: /tiago1.', max_length=100, verbose_name='namespace'),
        ),
        migrations.AddField(
            model_name='robot',
            name='ros_setup',
            field=models.CharField(blank=True, db_default='', default='', help_text='Of the distribution on the bridge’s computer whose rclpy and messages are used, such as /opt/ros/jazzy/setup.bash. Empty: the console’s own packages.', max_length=300, verbose_name='set-up script of ROS'),
        ),
        migrations.AddField(
            model_name='robot',
            name='static_peers',
            field=models.CharField(blank=True, db_default='', default='', help_text='Addresses of the robot’s computers, with spaces between them, if multicast does not reach them: 10.68.0.1 tiago-42c.', max_length=400, verbose_name='static peers'),
        ),
        migrations.AddField(
            model_name='robotprofile',
            name='ros',
            field=models.PositiveSmallIntegerField(choices=[(1, 'ROS 1'), (2, 'ROS 2')], db_default=1, default=1, help_text='A robot’s form asks how it is reached there: by a master, or in a domain.', verbose_name='ROS'),
        ),
        migrations.AlterField(
            model_name='robot',
            name='master_uri',
            field=models.CharField(blank=True, help_text='ROS_MASTER_URI of the robot, such as http://tiago-42c:11311.', max_length=200, verbose_name='ROS master'),
        ),
        migrations.AlterField(
            model_name='robotprofile',
            name='drive_type',
            field=models.CharField(choices=[('geometry_msgs/Twist', 'geometry_msgs/Twist'), ('geometry_msgs/TwistStamped', 'geometry_msgs/TwistStamped'), ('geometry_msgs/msg/Twist', 'geometry_msgs/msg/Twist'), ('geometry_msgs/msg/TwistStamped', 'geometry_msgs/msg/TwistStamped')], default='geometry_msgs/Twist', max_length=80, verbose_name='drive type'),
        ),
    ]
