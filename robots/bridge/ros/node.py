"""The bridge's rospy node: one robot's topics in, one drive topic out."""

from __future__ import annotations

import asyncio
import logging
import os
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist, TwistStamped
from msgspec import structs
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.bridge.config import BridgeConfig, Topic
from robots.bridge.core import Core, RosStatus
from robots.bridge.gate.geometry.arm_discs import Disc, Posture
from robots.bridge.gate.values import STILL, Pose, Velocity
from robots.bridge.probe_findings import BRIDGE, watchdog_name
from robots.bridge.ros.bounds.board import BOARD
from robots.bridge.ros.bounds.install import install
from robots.bridge.ros.bounds.listening import pause, speaker
from robots.bridge.ros.bounds.mailboxes import Mailboxes
from robots.bridge.ros.bounds.memory import end_without_memory
from robots.bridge.ros.bounds.texts import SENTENCE, cut, named
from robots.bridge.ros.message_types.classes import message_class
from robots.bridge.ros.message_types.convert import laser_scan, planar
from robots.bridge.ros.network.acknowledgements import Acknowledgements
from robots.bridge.ros.network.host_names import HostNames
from robots.bridge.ros.network.master import Master, MasterError, SystemState, is_own, why_silent
from robots.bridge.ros.network.master_monitor import MasterMonitor
from robots.bridge.ros.on_demand_topics import OnDemandTopics
from robots.bridge.ros.robot_runs import RunMonitor
from robots.bridge.ros.ros_worker import RateLimit, RosWorker
from robots.bridge.ros.sensors.arm_posture import PostureTopics
from robots.bridge.ros.sensors.depth import DepthTopics
from robots.bridge.ros.sensors.tf import TfTopics
from robots.bridge.ros.shutdown import refuse_shutdown
from robots.bridge.ros.tasks.motions import MotionTopics
from robots.bridge.ros.tasks.publishing import heard_by, immediate_publisher, publish
from robots.bridge.ros.tasks.speech import SpeechTopics
from robots.bridge.tasks.arm_posture import ArmPosture
from robots.bridge.tasks.head import Aim
from robots.bridge.tasks.input_routing import goal_topic
from robots.bridge.tasks.speech import Utterance
from robots.bridge.tasks.tasks import Swept
from robots.wire import MotionOffer, Use

log = logging.getLogger(__name__)

FLUSH_S = 0.1
LISTENER_PATIENCE_S = 0.5
DESCRIPTION_S = 5.0  # for hundreds of kilobytes, maybe by radio
JOINED_GAP_S = 5.0  # reading many motions may be 0.2 s of work, and who joins may go and come again
SONAR_ROUNDS = 3  # of readings that one topic's queue keeps
REACH_M = 0.9  # of an arm that nobody described, about the middle of the base
SEND_PATIENCE_S = 0.02  # by then the buffer of a listener to twists is not full by chance
ODOMETRY_WAITS = 20  # messages: the gate pairs scans with those between
RESTS_S = 0.08  # between reads of odometry, while the robot stands and nobody drives
RESTS = 0.005  # m/s or rad/s: less is standing
MOST_PROBLEMS = 10  # that are told at once
MOST_LOOKED_UP = 8  # nodes whose address is asked for in one survey


class RosBase:
    """The robot's base, as `Core` sees it; feeds `Core` from rospy's threads through the event loop."""

    def __init__(self, config: BridgeConfig) -> None:
        self._config = config
        self._master = Master(config.master_uri, BRIDGE)
        self._drive_topic = config.topics.drive.name
        self._drives: dict[str, rospy.Publisher] = {}  # the default, and one chosen instead
        self._acknowledgements: Acknowledgements | None = None
        self._stamped = config.topics.drive.type == "geometry_msgs/TwistStamped"
        self._sonars = {sonar.frame_id for sonar in config.topics.sonars}
        self._cancels: list[rospy.Publisher] = []
        self._tf: TfTopics | None = None
        self._costly: OnDemandTopics | None = None
        self._head: rospy.Publisher | None = None
        self._arm: ArmPosture | None = None
        self._motions: MotionTopics | None = None
        self._speech: SpeechTopics | None = None
        self._names = HostNames()
        self._is_unconnected = False  # whoever listens to the drive topic
        self._listened: dict[
            str, str
        ] = {}  # topics that the robot listened to at the last survey, and their types
        self._connecting = RosWorker("topics")
        self._reading = RosWorker("motions")
        self._joined = RateLimit(self._read_joined, JOINED_GAP_S)
        self._looking_up = RosWorker("motion")  # of its own: a list may take seconds
        self._watcher = MasterMonitor(self._master, self)
        self._described = False
        self._runs = RunMonitor()
        self._moves = True  # as the last odometry has it
        self._mail = Mailboxes(self._post, lambda: self._core.needs_fresh_sensors, speaker)
        self._loop: asyncio.AbstractEventLoop
        self._core: Core
        self._do: Callable[[Callable[[], None]], None]
        self._on_lost: Callable[[bool], None]

    # --- as Core sees it ---------------------------------------------------------------------------

    def publish(self, velocity: Velocity) -> None:
        """Send a twist, if the drive topic is up."""
        if self._drive is not None:
            twist = _twist(velocity)
            publish(self._drive, _stamp(twist) if self._stamped else twist)
            if self._acknowledgements is not None:
                self._acknowledgements.wrote(self._drive, time.monotonic())

    def acknowledged_s(self, now_s: float) -> float | None:
        """How long the robot's machine takes to acknowledge a twist; None if nothing new shows it."""
        return None if self._acknowledgements is None else self._acknowledgements.took_s(now_s)

    def drive_to(self, topic: str) -> None:
        """Twists go to this one of the attended topics from now on."""
        self._drive_topic = topic

    def cancel_all(self) -> None:
        """An empty goal id cancels everybody's goals: just what an emergency stop means."""
        cancels: list[Callable[[], None]] = [
            partial(publish, publisher, GoalID()) for publisher in self._cancels
        ]
        for part in (self._motions, self._speech):
            cancels += part.cancels if part is not None else []
        for cancel in cancels:
            try:
                cancel()
            except rospy.ROSException:  # a topic that is just being left
                log.exception("some goals could not be cancelled")

    def aim_head(self, aim: Aim) -> None:
        """Send the head there, if its topic is up."""
        head = self._config.topics.head
        if self._head is not None and head is not None:
            point = JointTrajectoryPoint(
                positions=[aim.pan, aim.tilt], time_from_start=rospy.Duration.from_sec(aim.seconds)
            )
            joints = [head.pan_joint, head.tilt_joint]
            publish(self._head, JointTrajectory(joint_names=joints, points=[point]))

    def play(self, goal_id: str, motion: str, action: str) -> None:
        """Send a motion's goal."""
        if self._motions is not None:
            self._motions.play(goal_id, motion, action)

    def cancel(self, goal_id: str, action: str) -> None:
        """Cancel this goal and no other."""
        if self._motions is not None:
            self._motions.cancel(goal_id, action)

    def sweep(self, motion: str, action: str, then: Swept) -> None:
        """Ask the robot for a motion's points as they are now, and tell `then` what the arm would sweep with them."""
        self._looking_up.do(lambda: self._sweep(motion, action, then))

    def _sweep(self, motion: str, action: str, then: Swept) -> None:
        """On the thread for it."""
        if goal_topic(Topic(action, "Action")).name not in self._listened:
            self._tell_listened(self._master.system_state())
        space = None
        with suppress(KeyError):
            if self._motions is not None:
                recorded, is_news = self._motions.look_up(action, motion)
                if is_news:
                    self.read_motions()
                now_s = time.monotonic()
                space = self._arm.sweep(recorded, now_s) if self._arm else ((0.0, 0.0, REACH_M),)
        self._post(lambda: then(space, time.monotonic()))

    def arm(self) -> tuple[Disc, ...] | None:
        """The discs that the arm covers now, by its joints; None if they do not tell."""
        return None if self._arm is None else self._arm.arm(time.monotonic())

    def read_motions(self) -> None:
        """Ask the robot for its motions."""
        motions = self._motions
        if motions is not None:
            self._reading.do(lambda: motions.read(self._offer))
        elif self._config.topics.motions:
            self._offer(self._config.topics.motions.name, [], "The robot’s ROS master was not there yet.")

    def _offer(self, action: str, motions: list[MotionOffer], text: str) -> None:
        self._post(lambda: self._core.tasks.capabilities.read(action, motions, text))

    def _read_joined(self) -> None:
        """Somebody began to perform motions, maybe others than before. On a thread of `_joined`."""
        if self._motions is not None:  # else they are being joined, and read after that
            self.read_motions()

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        """Pass a text on to the robot's voice. Whether the robot tells what becomes of it."""
        return self._speech is not None and self._speech.say(goal_id, utterance)

    def cancel_speech(self, goal_id: str, topic: str) -> None:
        """Cancel what is said under this goal and no other."""
        if self._speech is not None:
            self._speech.cancel_speech(goal_id, topic)

    def attend(self, use: Use, topics: frozenset[str]) -> None:
        """Be connected to these topics of that use and no others. Asks the master, hence elsewhere."""
        self._connecting.do(lambda: self._attend(use, topics))

    @property
    def _drive(self) -> rospy.Publisher | None:
        """Where twists go now."""
        return self._drives.get(self._drive_topic)

    @property
    def listeners(self) -> int:
        """How many nodes of the robot listen to the drive topic."""
        return len(heard_by(self._drive)) if self._drive is not None else 0

    def look(self, wanted: bool) -> None:
        """Whether anybody drives: what is costly to the robot is asked of it only then."""
        if self._costly is not None:
            self._costly.look(wanted)

    def hear(self) -> None:
        """On the loop, at each tick: what the robot told and could wait."""
        self._mail.take_waiting()

    def map_to_odom(self) -> Pose | None:
        """The odometry frame in the map's, if the robot has a map and somebody drives."""
        return self._tf.map_to_odom() if self._tf else None

    # --- life ----------------------------------------------------------------------------------------

    def start(
        self,
        loop: asyncio.AbstractEventLoop,
        core: Core,
        do: Callable[[Callable[[], None]], None],
        on_lost: Callable[[bool], None],
    ) -> None:
        """Begin to look for the master. After `on_lost` only another process can be this robot's node.

        It is told whether that is because another one took the name. `do` does on the loop what the robot told.
        """
        self._loop, self._core, self._do, self._on_lost = loop, core, do, on_lost
        os.environ["ROS_MASTER_URI"] = self._config.master_uri
        os.environ["ROS_PYTHON_LOG_CONFIG_FILE"] = str(Path(__file__).with_name("logging.yaml"))
        os.environ.setdefault("ROS_LOG_DIR", str(Path(self._config.state_dir) / "ros-log"))
        self._watcher.start()

    def stop(self) -> None:
        """Zero, then off the master's books."""
        self._watcher.end()
        if self._drive is None:
            return
        self.publish(STILL)
        time.sleep(FLUSH_S)  # the last bytes leave before the socket is closed
        leaving = threading.Thread(target=rospy.signal_shutdown, args=("bridge ends",), daemon=True)
        leaving.start()
        leaving.join(1.0)

    # --- the master (watcher.Node) ---------------------------------------------------------------------

    def begin(self) -> None:
        """Join the master and all topics."""
        topics = self._config.topics
        install(end_without_memory)
        refuse_shutdown(self._watcher.name_is_lost)
        rospy.init_node(
            BRIDGE.strip("/"), argv=[], disable_signals=True, disable_rostime=True, disable_rosout=True
        )
        # Delayed messages arrive all at once: a dropped one is a gap in odometry, and a gap ends the gate's memory.
        self._subscribe(topics.odometry, self._on_odometry, ODOMETRY_WAITS)
        pause(topics.odometry.name, lambda: 0.0 if self._core.needs_fresh_sensors or self._moves else RESTS_S)
        for scan in topics.scans:
            self._subscribe(Topic(scan.topic, "sensor_msgs/LaserScan"), self._on_scan(scan.topic))
        for name, sonars in Counter(sonar.topic for sonar in topics.sonars).items():
            # Sonars that share a topic speak one right after the other: none may push another's reading out.
            self._subscribe(Topic(name, "sensor_msgs/Range"), self._on_range, SONAR_ROUNDS * sonars)
        if topics.battery:
            self._subscribe(topics.battery, self._on_battery)
        if topics.charging:
            self._subscribe(topics.charging, self._on_charging)
        self._acknowledgements = Acknowledgements(
            socket.gethostbyname(urlsplit(self._config.master_uri).hostname or "")
        )
        self._cancels = [
            rospy.Publisher(f"{action}/cancel", GoalID, queue_size=1) for action in topics.cancel_on_stop
        ]
        self._drives = {topics.drive.name: self._drive_publisher(topics.drive.name)}
        if topics.head:
            self._head = rospy.Publisher(topics.head.topic, JointTrajectory, queue_size=1)
        if topics.motions:
            actions = self._core.tasks.routing.connected("motions")  # all that may be chosen
            self._motions = MotionTopics(
                actions,
                topics.motions.type,
                self._master,
                self._mail,
                self._core.tasks.motions,
                self._joined.do,
            )
        if topics.speech:
            self._speech = SpeechTopics(topics.speech, self._mail, self._core.tasks.speech)
        if topics.arm and topics.joint_states:
            self._arm = ArmPosture(topics.arm)
            self._describe()
            posture = PostureTopics(self._arm, self._on_posture)
            posture.subscribe(topics.joint_states, topics.motions if topics.arm.postures else None)
        depth, view = topics.depth, self._config.gate.depth
        if depth and view:
            self._tf = TfTopics(depth.base_frame)
            pictures = DepthTopics(depth, view, self._tf.frames, self._mail, self._core)
            self._costly = OnDemandTopics(self._connecting, self._tf, pictures)
        elif topics.map:
            self._tf = TfTopics()
            self._costly = OnDemandTopics(self._connecting, self._tf)

    def began_again(self) -> None:
        """The master was restarted, and maybe the robot with it."""
        self._runs.begin()
        self._described = False
        self._describe()
        self._post(self._core.tasks.refresh)

    def surveyed(self, system: SystemState) -> None:
        """Tell how the robot is; ask it for what it did not tell yet: it may have come after its master."""
        self.tell(self._survey(system))
        self._tell_listened(system)
        self._describe()
        if self._motions and not any(self._motions.repertoire.values()):
            self.read_motions()

    def _tell_listened(self, system: SystemState) -> None:
        self._listened = listened = _listened(system)
        self._post(lambda: self._core.tasks.routing.surveyed(listened, time.monotonic()))

    def tell(self, status: RosStatus) -> None:
        """How the connection to the master is."""
        short = structs.replace(status, text=cut(status.text, SENTENCE))
        self._post(lambda: self._core.ros_status(short, time.monotonic()))

    def lost(self, name_taken: bool) -> None:
        """This process's node has ended, or never began as it should."""
        self._post(lambda: self._on_lost(name_taken))

    def _describe(self) -> None:
        """Tell the arm's topics the robot's own description, as soon as it has one."""
        if self._arm and not self._described:
            master = Master(self._config.master_uri, BRIDGE, DESCRIPTION_S)
            try:
                description = master.parameter("/robot_description")
            except MasterError:
                description = None  # it is asked for again
            self._described = description is not None
            self._arm.describe(description)

    def _drive_publisher(self, name: str) -> rospy.Publisher:
        return immediate_publisher(name, TwistStamped if self._stamped else Twist, SEND_PATIENCE_S)

    def _attend(self, use: Use, topics: frozenset[str]) -> None:
        """On the thread for it. Whatever comes of it is told: choices count the answers."""
        connected = None
        try:
            self._connect(use, topics)
            connected = topics
        finally:
            self._post(lambda: self._core.tasks.routing.attended(use, connected, time.monotonic()))

    def _connect(self, use: Use, topics: frozenset[str]) -> None:
        if use == "drive":
            for name in topics - self._drives.keys():
                self._drives[name] = publisher = self._drive_publisher(name)
                self._await_listener(publisher)
            for name in self._drives.keys() - topics:
                self._drives.pop(name).unregister()
        elif use == "speech" and self._speech:
            self._speech.attend(topics)

    def _await_listener(self, publisher: rospy.Publisher) -> None:
        """A moment, so that a robot whose velocities go elsewhere now does not seem to be away."""
        deadline_s = time.monotonic() + LISTENER_PATIENCE_S
        while not heard_by(publisher) and time.monotonic() < deadline_s:
            time.sleep(FLUSH_S / 10)

    def _survey(self, system: SystemState) -> RosStatus:
        topics = self._config.topics
        drive = Topic(self._drive_topic, topics.drive.type)
        own = {BRIDGE, watchdog_name(self._config.robot_id)}
        foreign = named(set(system.publishers.get(drive.name, [])) - own)
        wanted = [drive, topics.odometry]
        wanted += [Topic(scan.topic, "sensor_msgs/LaserScan") for scan in topics.scans]
        problems = BOARD.texts()
        if system.is_cut:
            problems.append("The robot has too many topics or services: some are not known here.")
        if self._tf is not None and self._tf.frames.is_full:
            problems.append("tf tells of too many frames: some are not kept.")
        problems += [_wrong_type(topic, system.types) for topic in wanted]
        problems += self._unresolved(system.publishers.get(topics.odometry.name, []))
        problems.append(self._unconnected(drive, system.subscribers.get(drive.name, [])))
        told = [cut(problem, SENTENCE) for problem in problems if problem]
        return RosStatus("connecting", "", foreign, told[:MOST_PROBLEMS])

    def _unresolved(self, nodes: Collection[str]) -> list[str]:
        """In words, what we need and cannot call, for the name of its host is not known here."""
        uris = [uri for node in list(nodes)[:MOST_LOOKED_UP] if (uri := self._master.node_uri(node))]
        return [
            f"The robot calls itself {host or 'by no address'}, which cannot be resolved here: give it a host alias."
            for host in sorted(self._names.unknown({_host(uri) for uri in uris}))
        ]

    def _unconnected(self, drive: Topic, nodes: Collection[str]) -> str:
        """In words, if somebody listens to the drive topic and nobody connects, as it was at the survey before, too.

        Of what type they take the master says nothing: its type of the topic is ours, as we advertise it.
        """
        listening = sorted(node for node in nodes if not is_own(node))
        before, self._is_unconnected = self._is_unconnected, bool(listening) and not self.listeners
        if not (before and self._is_unconnected):
            return ""
        node = listening[0]
        uri = self._master.node_uri(node)
        why = uri and why_silent(uri)
        if why:
            return f"{node} should listen to {drive.name}, and {why}."
        return (
            f"{node} listens to {drive.name} and does not connect: it takes no {drive.type}, "
            "or cannot reach this computer at its advertised address."
        )

    # --- topics --------------------------------------------------------------------------------------

    def _subscribe(self, topic: Topic, callback: Callable[[Any], None], queue: int = 1) -> None:
        rospy.Subscriber(topic.name, message_class(topic.type), callback, queue_size=queue, tcp_nodelay=True)

    def _on_odometry(self, message: Any) -> None:
        arrival_s, wall_s = time.monotonic(), time.time()
        pose, velocity = planar(message)
        self._moves = not all(abs(part) < RESTS for part in velocity)
        stamp_s, run = message.header.stamp.to_sec(), self._runs.of(message._connection_header)
        self._mail.post(
            "odometry",
            lambda: self._core.odometry(stamp_s, arrival_s, pose, velocity, wall_s, run),
            ODOMETRY_WAITS,
            can_wait=True,
        )

    def _on_scan(self, source: str) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            scan = laser_scan(message, source, time.monotonic())
            self._mail.post(source, lambda: self._core.laser(scan))

        return receive

    def _on_range(self, message: Any) -> None:
        arrival_s, stamp_s = time.monotonic(), message.header.stamp.to_sec()
        frame_id = message.header.frame_id.lstrip("/")
        if frame_id in self._sonars:
            self._mail.post(
                ("sonar", frame_id),
                lambda: self._core.range(frame_id, stamp_s, arrival_s, message.range),
                can_wait=True,
            )

    def _on_posture(self, arm: Posture, arrival_s: float) -> None:
        self._mail.post("posture", lambda: self._core.posture(arm, arrival_s), can_wait=True)

    def _on_battery(self, message: Any) -> None:
        percent = message.percentage * 100 if hasattr(message, "percentage") else message.data
        self._mail.post("battery", lambda: self._core.battery(float(percent)), can_wait=True)

    def _on_charging(self, message: Any) -> None:
        self._mail.post("charging", lambda: self._core.charging(bool(message.data)), can_wait=True)

    def _post(self, call: Callable[[], None]) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._do, call)


def _twist(velocity: Velocity) -> Twist:
    twist = Twist()
    twist.linear.x, twist.linear.y, twist.angular.z = velocity
    return twist


def _stamp(twist: Twist) -> TwistStamped:
    stamped = TwistStamped(twist=twist)
    stamped.header.stamp = rospy.Time.from_sec(time.time())
    return stamped


def _listened(system: SystemState) -> dict[str, str]:
    """The topics that somebody else than the console listens to, and their types."""
    return {
        topic: system.types[topic]
        for topic, nodes in system.subscribers.items()
        if topic in system.types and not all(map(is_own, nodes))
    }


def _host(uri: str) -> str:
    """Empty if there is none in it."""
    try:
        return urlsplit(uri).hostname or ""
    except ValueError:
        return ""


def _wrong_type(topic: Topic, types: dict[str, str]) -> str:
    found = types.get(topic.name)
    if found in (None, "*", topic.type):
        return ""
    return f"{topic.name} is {found} on the robot, {topic.type} in the registry."
