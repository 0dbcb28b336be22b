"""The bridge's rospy node: subscribes to one robot's topics and publishes to its drive topic."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import urlsplit

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist, TwistStamped

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.core import Core
from robots.bridge.robot.description.descriptions import Descriptions
from robots.bridge.robot.incoming.reception import DIAGNOSTICS_WAIT, ODOMETRY_WAITS, Reception
from robots.bridge.robot.inputs import Inputs
from robots.bridge.robot.interface import RobotParameters, RobotSide
from robots.bridge.robot.network.surveys import MOST_LOOKED_UP, Surveys
from robots.bridge.robot.parts import Parts, kinds_in
from robots.bridge.robot.sensors.depth import DepthReception
from robots.bridge.robot.sensors.diagnostics import statuses
from robots.bridge.robot.sensors.joints import JointReception
from robots.bridge.robot.sensors.on_demand_topics import OnDemandTopics
from robots.bridge.robot.tasks.speech import Voices
from robots.bridge.robot.worker import Worker
from robots.bridge.robot_reports import RosStatus
from robots.bridge.ros import tasks
from robots.bridge.ros.bounds.install import install
from robots.bridge.ros.bounds.listening import hurry, pause, speaker
from robots.bridge.ros.network.acknowledgements import Acknowledgements
from robots.bridge.ros.network.host_names import HostNames
from robots.bridge.ros.network.master_monitor import MasterMonitor
from robots.bridge.ros.network.parameters import MasterParameters
from robots.bridge.ros.robot_runs import RunMonitor
from robots.bridge.ros.sensors.brief import BRIEF
from robots.bridge.ros.sensors.depth import DepthMessages, DepthTopics
from robots.bridge.ros.sensors.posture_topics import PostureTopics
from robots.bridge.ros.sensors.tf import TfTopics
from robots.bridge.ros.shutdown import refuse_shutdown
from robots.bridge.ros.tasks.publishing import heard_by, immediate_publisher, publish, stamped
from robots.bridge.tasks.holder_tasks import HolderTasks
from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.configuration.robot_ros import ros1
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.graph import SystemState, is_own
from robots.shared.processes.memory import end_without_memory
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.ros.master import Master, MasterError, why_silent
from robots.shared.ros.message_types.classes import message_class
from robots.shared.sentences import say
from robots.shared.wire import Use

log = logging.getLogger(__name__)
P = TypeVar("P")
PARTS = kinds_in(tasks)

FLUSH_S = 0.1
LISTENER_PATIENCE_S = 0.5
DESCRIPTION_S = 5.0  # the description has hundreds of kilobytes, and may come by radio
SONAR_ROUNDS = 3  # readings of each sonar in its topic's queue
SEND_PATIENCE_S = 0.02  # if a listener's buffer is full for longer, the listener does not read
DIAGNOSED_S = 0.5  # between reads of diagnostics: nodes report once a second
# Between reads while the robot stands without a driver: shorter than each sensor's limit
RESTS_S, SONAR_RESTS_S = 0.1, 0.2


class RosBase:
    """The robot's ROS interface for `Core`. Passes data from rospy's threads to `Core` on the event loop."""

    def __init__(self, config: BridgeConfig) -> None:
        self.config = config
        self._master = Master(ros1(config.ros).master_uri, BRIDGE)
        self.parameters: RobotParameters = MasterParameters(self._master)
        self._drives: dict[str, rospy.Publisher] = {}  # by topic: the default and a chosen one
        self._acknowledgements: Acknowledgements | None = None
        self._stamped = config.topics.drive.type == "geometry_msgs/TwistStamped"
        self._cancels: list[rospy.Publisher] = []
        self._tf: TfTopics | None = None
        self._on_demand: OnDemandTopics | None = None
        self.posture = ArmPosture(config.topics.arm) if config.topics.joint_states else None
        self._names = HostNames()
        self._is_unconnected = False  # a listener of the drive topic did not connect
        self._topic_worker = Worker("topics")
        self._monitor = MasterMonitor(self._master, self)
        self._runs = RunMonitor()
        self._reception = Reception(config.topics, speaker)
        self.mail, self.post = self._reception.mail, self._reception.post
        self._surveys = Surveys(config, self._reception, self._master.system_state, self._master.node_uri)
        self.find_listener = self._surveys.find_listener
        self._inputs = Inputs(config.topics.drive.name, self._reception, self._topic_worker, self._connect)
        self.parts = Parts(PARTS, self._inputs)
        self._descriptions = Descriptions(config.topics, self._description, self.posture, self._reception)
        self._on_lost: Callable[[bool], None]

    @property
    def watched(self) -> bool:
        """Whether somebody looks at views."""
        return self._reception.watched

    @watched.setter
    def watched(self, watched: bool) -> None:
        self._reception.watched = watched

    def joints(self, now_s: float) -> dict[str, float]:
        """Return the positions (rad or m) of joints of the robot's description, as far as they are known."""
        return self.posture.shown(now_s) if self.posture else {}

    # --- called by Core ----------------------------------------------------------------------------

    def part(self, kind: type[P]) -> P | None:
        """Return the part that does this; None: the robot has none, or is not connected yet."""
        return self.parts.find(kind)

    def joint(self, name: str) -> float | None:
        """Return the position of a joint (rad or m); None if it was not reported lately."""
        return self.posture.joint(name, time.monotonic()) if self.posture else None

    def publish(self, velocity: Velocity) -> None:
        """Publish a twist if the drive topic is connected."""
        if self._drive is not None:
            twist = _twist(velocity)
            agree = self._reception.core.clocks_agree
            publish(self._drive, stamped(twist, agree) if self._stamped else twist)
            if self._acknowledgements is not None:
                self._acknowledgements.wrote(self._drive, time.monotonic())

    def take_odometry(self) -> None:
        self._reception.take_odometry()

    def take_waiting(self) -> None:
        self._reception.take_waiting()

    def acknowledged_s(self, now_s: float) -> float | None:
        """Return how long (s) the robot's computer takes to acknowledge a twist; None if nothing is new."""
        return None if self._acknowledgements is None else self._acknowledgements.took_s(now_s)

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must: with an empty goal id."""
        for publisher in self._cancels:
            try:
                publish(publisher, GoalID())
            except rospy.ROSException:  # its topic is being closed
                log.exception("goals of one action were not cancelled")
        self.parts.cancel_all()

    def located(self) -> tuple[float, Pose] | None:
        """Return the newest transform from map to odometry and its stamp, if a person drives."""
        return self._tf.located() if self._tf else None

    @property
    def _drive(self) -> rospy.Publisher | None:
        """Return the publisher that twists use now."""
        return self._drives.get(self._inputs.drive)

    @property
    def listeners(self) -> int:
        """Return the number of the robot's nodes that listen to the drive topic."""
        return len(heard_by(self._drive)) if self._drive is not None else 0

    def hurry(self, wanted: bool) -> None:
        """Read sensors at once, and each message, until that is no longer wanted."""
        hurry(wanted)

    def use_on_demand_topics(self, wanted: bool) -> None:
        """Subscribe to the costly topics (depth, tf) only while a person drives."""
        if self._on_demand is not None:
            self._on_demand.set_wanted(wanted)

    def map_to_odom(self) -> Pose | None:
        """Return the odometry frame in the map frame, if the robot has a map and a person drives."""
        located = self.located()
        return located and located[1]

    # --- life ----------------------------------------------------------------------------------------

    def start(
        self,
        loop: asyncio.AbstractEventLoop,
        core: Core,
        run_on_loop: Callable[[Callable[[], None]], None],
        on_lost: Callable[[bool], None],
    ) -> None:
        """Start the search for the master. After `on_lost`, only a new process can be this robot's node.

        `on_lost` gets True if another node took the name. `run_on_loop` runs calls with the robot's data on
        the loop.
        """
        self._reception.start(loop, core, run_on_loop)
        self._on_lost = on_lost
        os.environ["ROS_MASTER_URI"] = self._master.uri
        os.environ.setdefault("ROS_LOG_DIR", str(Path(self.config.state_dir) / "ros-log"))
        self._monitor.start()

    def stop(self) -> None:
        """Publish zero and unregister from the master."""
        self._monitor.close()
        if self._drive is None:
            return
        self.publish(STILL)
        time.sleep(FLUSH_S)  # the last bytes leave before the socket is closed
        leaving = threading.Thread(target=rospy.signal_shutdown, args=("bridge ends",), daemon=True)
        leaving.start()
        leaving.join(1.0)

    # --- called by the master monitor (master_monitor.Node) ------------------------------------------

    def join(self) -> None:
        """Register at the master and connect all topics."""
        topics = self.config.topics
        install(end_without_memory)
        refuse_shutdown(self._monitor.name_is_lost)
        rospy.init_node(
            BRIDGE.strip("/"), argv=[], disable_signals=True, disable_rostime=True, disable_rosout=True
        )
        # Delayed messages arrive all at once. A dropped one is a gap in odometry, and a gap clears the gate's memory.
        self._subscribe(topics.odometry, self._on_odometry, ODOMETRY_WAITS)
        pause(
            topics.odometry.name,
            lambda: 0.0 if self._reception.moves else RESTS_S,
            hurried_s=0.0,
            newest_only=True,
        )
        for scan in topics.scans:
            self._subscribe(Topic(scan.topic, "sensor_msgs/LaserScan"), self._on_scan(scan.topic))
        for name, sonars in Counter(sonar.topic for sonar in topics.sonars).items():
            # Sonars that share a topic publish together: no reading may push another out of the queue.
            self._subscribe(Topic(name, "sensor_msgs/Range"), self._on_range, SONAR_ROUNDS * sonars)
            pause(
                name, lambda: 0.0 if self._reception.moves or self.watched else SONAR_RESTS_S, hurried_s=0.0
            )
        if topics.battery:
            self._subscribe(topics.battery, self._reception.battery)
        if topics.charging:
            self._subscribe(topics.charging, self._on_charging)
        if topics.diagnostics:
            self._subscribe(topics.diagnostics, self._on_diagnostics, DIAGNOSTICS_WAIT)
            pause(topics.diagnostics.name, lambda: DIAGNOSED_S)
        self._acknowledgements = Acknowledgements(
            socket.gethostbyname(urlsplit(self._master.uri).hostname or "")
        )
        self._cancels = [
            rospy.Publisher(f"{action}/cancel", GoalID, queue_size=1) for action in topics.cancelled
        ]
        self._drives = {topics.drive.name: self._drive_publisher(topics.drive.name)}
        self.parts.connect(self)
        if self.posture and topics.joint_states:
            joints = JointReception(self.posture, self._reception.posture if topics.arm else None)
            motions = topics.motions if topics.arm and topics.arm.postures else None
            PostureTopics(joints).subscribe(topics.joint_states, motions)
        self._descriptions.read()
        depth, view = topics.depth, self.config.gate.depth
        if depth and view:
            self._tf = TfTopics(depth.base_frame)
            reception = DepthReception(depth, view, self._tf.frames, self._reception, DepthMessages())
            pictures = DepthTopics(depth, reception)
            self._on_demand = OnDemandTopics(self._topic_worker, self._tf, pictures)
        elif topics.map or topics.navigation:
            self._tf = TfTopics()
            self._on_demand = OnDemandTopics(self._topic_worker, self._tf)

    def restarting(self) -> None:
        """Forget where the robot is: a robot that stands tells its new pose only once."""
        self._reception.restarting()

    def restarted(self) -> None:
        """Handle a restart of the master, and maybe of the robot."""
        self._runs.start_run()
        self._surveys.restarted()
        self._descriptions.restarted()
        self._reception.restarted()

    def surveyed(self, system: SystemState) -> None:
        """Report the robot's state. Read missing data, since the robot may start after its master."""
        self._surveys.surveyed(system, self._inputs.drive, self._problems(system))
        self._follow_clock(system)
        self._descriptions.surveyed(system)
        self.parts.surveyed()

    def _follow_clock(self, system: SystemState) -> None:
        """Report whether the robot's nodes follow a simulated clock."""
        try:
            simulated = "/clock" in system.publishers and self._master.parameter("/use_sim_time") is True
        except MasterError:
            return  # the next survey asks again
        self._reception.follow_clock(simulated)

    @property
    def tasks(self) -> HolderTasks:
        """The tasks of the holder. Use them on the event loop only."""
        return self._reception.core.tasks

    def report(self, status: RosStatus) -> None:
        """Report the state of the connection to the master."""
        self._surveys.report(status)

    def lost(self, name_taken: bool) -> None:
        """Report that this process's node ended or failed to start."""
        self.post(lambda: self._on_lost(name_taken))

    def _description(self) -> object:
        return Master(self._master.uri, BRIDGE, DESCRIPTION_S).parameter("/robot_description")

    def _drive_publisher(self, name: str) -> rospy.Publisher:
        return immediate_publisher(name, TwistStamped if self._stamped else Twist, SEND_PATIENCE_S)

    def _connect(self, use: Use, topics: frozenset[str]) -> None:
        if use == "drive":
            for name in topics - self._drives.keys():
                self._drives[name] = publisher = self._drive_publisher(name)
                self._await_listener(publisher)
            for name in self._drives.keys() - topics:
                self._drives.pop(name).unregister()
        elif use == "speech" and (speech := self.part(Voices)):
            speech.attend(topics)

    def _await_listener(self, publisher: rospy.Publisher) -> None:
        """Wait a moment for a listener: otherwise a robot with a new drive topic would look disconnected."""
        deadline_s = time.monotonic() + LISTENER_PATIENCE_S
        while not heard_by(publisher) and time.monotonic() < deadline_s:
            time.sleep(FLUSH_S / 10)

    def _problems(self, system: SystemState) -> list[str]:
        """Return what is wrong with this robot, beside what every robot may have wrong."""
        topics = self.config.topics
        problems: list[str] = []
        if self._tf is not None and self._tf.frames.is_full:
            problems.append(say("The robot’s tf has too many frames: the console does not keep all of them."))
        problems += self._unresolved(system.publishers.get(topics.odometry.name, []))
        drive = Topic(self._inputs.drive, topics.drive.type)
        if unconnected := self._unconnected(drive, system.subscribers.get(drive.name, [])):
            problems.append(unconnected)
        return problems

    def _unresolved(self, nodes: Collection[str]) -> list[str]:
        """Return a sentence for each host name of the robot that this computer cannot resolve."""
        uris = [uri for node in list(nodes)[:MOST_LOOKED_UP] if (uri := self._master.node_uri(node))]
        return [
            say(
                "The robot calls itself {host}, which cannot be resolved here: give it a host alias.",
                host=host,
            )
            if host
            else say(
                "A node of the robot has an address that cannot be read: check ROS_IP and ROS_HOSTNAME on the robot."
            )
            for host in sorted(self._names.unknown({_host(uri) for uri in uris}))
        ]

    def _unconnected(self, drive: Topic, nodes: Collection[str]) -> str:
        """Return a sentence if a node listens to the drive topic but did not connect at two surveys in a row.

        The master does not know the listener's type: it returns ours, since we advertise the topic.
        """
        listening = sorted(node for node in nodes if not is_own(node))
        before, self._is_unconnected = self._is_unconnected, bool(listening) and not self.listeners
        if not (before and self._is_unconnected):
            return ""
        node = listening[0]
        uri = self._master.node_uri(node)
        why = uri and why_silent(uri)
        if why:
            return say("{node} should listen to {topic}, but {why}.", node=node, topic=drive.name, why=why)
        return say(
            "{node} listens to {topic} and does not connect: it takes no {type}, or cannot reach this computer at its "
            "advertised address.",
            node=node,
            topic=drive.name,
            type=drive.type,
        )

    # --- topics --------------------------------------------------------------------------------------

    def _subscribe(self, topic: Topic, callback: Callable[[Any], None], queue: int = 1) -> None:
        kind = BRIEF.get(topic.type) or message_class(topic.type)
        rospy.Subscriber(topic.name, kind, callback, queue_size=queue, tcp_nodelay=True)

    def _on_odometry(self, message: Any) -> None:
        run = self._runs.of(message._connection_header)
        by = speaker()
        self._reception.odometry(
            message.stamp_s, message.planar_pose, message.velocity, run, by.stands_for if by else 1
        )

    def _on_scan(self, source: str) -> Callable[[Any], None]:
        return lambda message: self._reception.scan(
            message.scan._replace(source=source, arrival_s=time.monotonic())
        )

    def _on_range(self, message: Any) -> None:
        self._reception.range(message.header.frame_id, message.header.stamp.to_sec(), message.range)

    def _on_charging(self, message: Any) -> None:
        self._reception.charging(bool(message.data))

    def _on_diagnostics(self, message: Any) -> None:
        self._reception.diagnostics(statuses(message, message._connection_header.get("callerid", "")))


def _twist(velocity: Velocity) -> Twist:
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.z = velocity
    return twist


def _host(uri: str) -> str:
    """Return the host of a URI; empty if there is none."""
    try:
        return urlsplit(uri).hostname or ""
    except ValueError:
        return ""


if TYPE_CHECKING:
    SIDE: Callable[[BridgeConfig], RobotSide] = RosBase
