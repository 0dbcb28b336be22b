"""The bridge's rclpy node: subscribes to one robot's topics and publishes to its drive topic."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec import structs
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import InvalidHandle

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.core import Core
from robots.bridge.robot.description.descriptions import Descriptions
from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.inputs import Inputs
from robots.bridge.robot.interface import RobotParameters, RobotSide
from robots.bridge.robot.network.surveys import Surveys
from robots.bridge.robot.parts import Parts, kinds_in
from robots.bridge.robot.sensors.depth import DepthReception
from robots.bridge.robot.sensors.joints import JointReception
from robots.bridge.robot.sensors.on_demand_topics import OnDemandTopics
from robots.bridge.robot.tasks.speech import Voices
from robots.bridge.robot.worker import Worker
from robots.bridge.robot_reports import RosStatus
from robots.bridge.ros2 import tasks
from robots.bridge.ros2.drive import FLUSH_S, Drives, publish_still, velocity_bytes
from robots.bridge.ros2.followed import FollowedTopics
from robots.bridge.ros2.network.clock import SimulatedClock
from robots.bridge.ros2.network.domain_monitor import DomainMonitor
from robots.bridge.ros2.network.graph import Graph, node_name
from robots.bridge.ros2.network.interfaces import Joined
from robots.bridge.ros2.network.parameters import NodeParameters
from robots.bridge.ros2.network.presence import Presence
from robots.bridge.ros2.network.survey import Listeners, Problems, is_there, wanted_kind
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.sensors.depth import DepthMessages, DepthTopics
from robots.bridge.ros2.sensors.description import DescriptionTopic
from robots.bridge.ros2.sensors.tf import TfTopics
from robots.bridge.ros2.sensors.topics import SensorTopics
from robots.bridge.ros2.tasks.cancels import MOST_ACTIONS, Cancels
from robots.bridge.tasks.holder_tasks import HolderTasks
from robots.bridge.tasks.input_routing import goal_topic
from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.configuration.robot_ros import ros2
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.graph import SystemState
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.sentences import say
from robots.shared.texts import MOST_NODES
from robots.shared.wire import Use

log = logging.getLogger(__name__)
P = TypeVar("P")
PARTS = kinds_in(tasks)

LEAVE_S = 1.0
LISTENER_PATIENCE_S = 0.5
# Between reads while the robot stands without a driver: shorter than each sensor's limit, and no queue overflows.
# While it moves or has a driver: the gate sees the age of all that it reads. A rest begins anew with each twist: with
# this length no read holds up the next one, of a page (30 a second) or a program (50).
RESTS_S, MOVES_S = 0.05, 0.009
HEARD_S = 2.0  # a publisher of odometry that is silent for longer may have ended


class RosBase:
    """The robot's ROS interface for `Core`. Passes data from the executor's thread to `Core` on the event loop."""

    def __init__(self, config: BridgeConfig) -> None:
        self.config = config
        self._ros = ros2(config.ros)
        self._twist = config.topics.drive.type  # of velocities, as the robot takes them
        self._driven = frozenset(
            {config.topics.drive.name}
        )  # topics of velocities: the default and a chosen one
        self._cancels: Cancels | None = None
        self._tf: TfTopics | None = None
        self._on_demand: OnDemandTopics | None = None
        self.posture = ArmPosture(config.topics.arm) if config.topics.joint_states else None
        self._topic_worker = Worker("topics")
        self._monitor = DomainMonitor(self)
        self._drives = Drives(PublisherEventCallbacks(matched=lambda _: self._monitor.look()))
        self._hurries = False
        self._runs: set[int] = set()  # of odometry, at the last survey that heard any
        self._diagnosing: dict[bytes, str] = {}  # nodes by their publisher of diagnostics
        self._text: str | None = None  # the description at the last survey
        self._reception = Reception(config.topics)
        self.mail, self.post = self._reception.mail, self._reception.post
        self._surveys = Surveys(config, self._reception, self._system, self._run_of_map_server)
        self.find_listener = self._surveys.find_listener
        self._inputs = Inputs(config.topics.drive.name, self._reception, self._topic_worker, self._connect)
        self.parts = Parts(PARTS, self._inputs)
        self.parameters: RobotParameters
        self.participant: Participant
        self._joined: Joined
        self.graph: Graph
        self.followed: FollowedTopics
        self._presence: Presence
        self._clock: SimulatedClock
        self._misfits: Problems
        self._listeners: Listeners
        self._sensors: SensorTopics
        self._description: DescriptionTopic
        self._descriptions: Descriptions
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
        self._drives.newest = velocity
        self._drives.sent += 1
        drive = self._drive
        if drive is not None:
            try:
                drive.publish(velocity_bytes(drive.msg_type, velocity, self._reception.core.clocks_agree))
                self.participant.read_soon()
            except InvalidHandle:  # its topic is being closed
                log.warning("a velocity was not published: its topic is closed")

    def take_odometry(self) -> None:
        self._reception.take_odometry()

    def take_waiting(self) -> None:
        self._reception.take_waiting()

    def acknowledged_s(self, _now_s: float) -> float | None:
        """Return None: DDS does not tell when the robot's computer got a twist."""
        return None

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""
        if self._cancels is not None:
            self._cancels.cancel_all()
        self.parts.cancel_all()

    def located(self) -> tuple[float, Pose] | None:
        """Return the newest transform from map to odometry and its stamp, if a person drives."""
        return self._tf.located() if self._tf else None

    @property
    def _drive(self) -> Any:
        """Return the publisher that twists use now; None: there is none yet."""
        return self._drives.by_topic.get(self._inputs.drive)

    @property
    def listeners(self) -> int:
        """Return the number of the robot's nodes that listen to the drive topic."""
        drive = self._drive
        try:
            return self._listeners.of(self._inputs.drive, drive) if drive is not None else 0
        except InvalidHandle:  # its topic is being closed
            return 0

    def hurry(self, wanted: bool) -> None:
        """Read messages soon if wanted, else in larger batches."""
        begins, self._hurries = wanted and not self._hurries, wanted
        if begins and (participant := getattr(self, "participant", None)):
            participant.read_soon()

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
        """Start the search for the robot. After `on_lost`, only a new process can be this robot's bridge.

        `on_lost` gets True if another bridge has the robot. `run_on_loop` runs calls with the robot's data on the
        loop.
        """
        self._reception.start(loop, core, run_on_loop)
        self._on_lost = on_lost
        self._monitor.start()

    def stop(self) -> None:
        """Publish zero and leave the domain."""
        self._monitor.close()
        if self._drive is not None:
            self.publish(STILL)
            time.sleep(FLUSH_S)  # the zero leaves before the participant does
        if participant := getattr(self, "participant", None):
            participant.close(LEAVE_S)

    # --- called by the domain monitor (domain_monitor.Node) ------------------------------------------

    def join(self) -> None:
        """Join the robot's domain and read its sensors."""
        config, namespace, reception = self.config, self._ros.namespace, self._reception
        self._joined = Joined(self._ros)
        self.participant = participant = Participant(
            BRIDGE.strip("/"),
            self._ros.domain_id,
            lambda: self.lost(name_taken=False),
            lambda: MOVES_S if self._hurries or reception.moves else RESTS_S,
        )
        self.graph = Graph(participant.node)
        self._listeners = Listeners(Graph(participant.node))
        self.parameters = parameters = NodeParameters(participant)
        self._clock = SimulatedClock(self.graph, parameters, config.topics.odometry.name)
        self._misfits = Problems(self.graph)
        self._presence = Presence(participant, f"{namespace}{BRIDGE}/presence", socket.gethostname())
        self.followed = FollowedTopics(participant, self.graph)
        self._description = DescriptionTopic(self.followed, f"{namespace}/robot_description")
        self._descriptions = Descriptions(
            config.topics, self._description.read, self.posture, reception, f"{namespace}/tf"
        )
        arm = reception.posture if config.topics.arm else None
        joints = JointReception(self.posture, arm) if self.posture else None
        self._sensors = SensorTopics(config.topics, reception, joints, self._node_of, self._monitor.look)
        self._sensors.listen(participant)
        depth, view = config.topics.depth, config.gate.depth
        if depth and view:
            self._tf = TfTopics(participant, namespace, depth.base_frame)
            pictures = DepthReception(depth, view, self._tf.frames, reception, DepthMessages())
            self._on_demand = OnDemandTopics(
                self._topic_worker, self._tf, DepthTopics(participant, self.followed, depth, pictures)
            )
        elif config.topics.map or config.topics.navigation:
            self._tf = TfTopics(participant, namespace)
            self._on_demand = OnDemandTopics(self._topic_worker, self._tf)
        participant.start()

    def other_bridge(self) -> str | None:
        """Say that this bridge is there; return the host of another one that has the robot."""
        found = self.holds or is_there(self.graph, self.config.topics, self._inputs.drive)
        return self._presence.step(time.monotonic(), found)

    @property
    def holds(self) -> bool:
        """Return whether this bridge has the robot."""
        return self._presence.holds

    @property
    def cut_off(self) -> bool:
        """Return whether the robot is silent, and may be in a network that this process does not use."""
        return not self._heard() and self._joined.new()

    def hold(self) -> None:
        """Connect to the drive topic: the robot is this bridge's."""
        topics = self.config.topics
        self._cancels = Cancels(self.participant.node, topics.cancelled, self._ros.namespace)
        self._twist = wanted_kind(self.graph, topics.drive, self._twist)
        self._drives.connect(self.participant.node, {topics.drive.name}, self._twist)
        self.parts.connect(self)

    def survey(self) -> None:
        """Report the robot's state. Read missing data, since the robot may start after its bridge."""
        drive = self._inputs.drive
        if not is_there(self.graph, self.config.topics, drive):
            text = say("Nothing of this robot answers in domain {domain}.", domain=self._ros.domain_id)
            self.report(RosStatus("waiting", text))
            return
        if not self.holds or self._cancels is None:
            return
        self.followed.follow()
        self._follow_kind()
        self._cancels.look()
        system = self._system()
        self._surveys.surveyed(system, drive, self._problems(drive))
        self._reception.follow_clock(self._clock.look())
        self._look_for_restart()
        if self._description.text != self._text:
            self._text = self._description.text
            self._descriptions.restarted()
        self._descriptions.surveyed(system)
        self.parts.surveyed()

    def _problems(self, drive: str) -> list[str]:
        found = self._misfits.of(drive, self._twist)
        if self._tf is not None and self._tf.frames.is_full:
            found.append(say("The robot’s tf has too many frames: the console does not keep all of them."))
        if self._cancels is not None and self._cancels.is_full:
            words = "The robot’s domain has many actions: a stop cancels goals of its profile’s and of {count} more."
            found.append(say(words, count=MOST_ACTIONS))
        return found

    def report(self, status: RosStatus) -> None:
        """Report the state of the connection to the robot."""
        self._surveys.report(status)

    def lost(self, name_taken: bool) -> None:
        """Report that this process cannot be the robot's bridge any more."""
        self.post(lambda: self._on_lost(name_taken))

    def _look_for_restart(self) -> None:
        """Notice that all publishers of odometry are new: the robot was restarted."""
        heard = self._heard()
        if heard and self._runs and not heard & self._runs:
            log.info("the robot was restarted")
            self._runs = heard
            self._reception.restarting()
            self._surveys.restarted()
            self._descriptions.restarted()
            self._reception.restarted()
        self._runs = self._runs or heard

    def _heard(self) -> set[int]:
        """Return the runs of odometry that were heard lately."""
        now_s = time.monotonic()
        return {run for run, heard_s in list(self._sensors.runs.values()) if now_s - heard_s < HEARD_S}

    @property
    def tasks(self) -> HolderTasks:
        """The tasks of the holder. Use them on the event loop only."""
        return self._reception.core.tasks

    # --- who is in the domain ---------------------------------------------------------------------------

    def _system(self) -> SystemState:
        """Look for the nodes of all topics that matter to the bridge."""
        topics, namespace = self.config.topics, self._ros.namespace
        entered = [topic for topic in (topics.drive, topics.speech, topics.motions) if topic]
        inputs = [one for topic in entered for one in (topic, *topic.others)]
        inputs += [
            Topic(one.name, one.type) for one in self.config.allowed if one.what in ("choose", "publish")
        ]
        seen = [topic for topic in (topics.odometry, topics.joint_states, topics.map) if topic]
        names = [topic.name for topic in (*map(goal_topic, inputs), *seen)]
        names += [scan.topic for scan in topics.scans]
        return self.graph.system([*names, self._inputs.drive, f"{namespace}/tf"])

    def _run_of_map_server(self, node: str) -> object:
        """Return what differs after a restart of a node that publishes the map."""
        topic = self.config.topics.map
        publishers = self.graph.publishers(topic.name) if topic else []
        return frozenset(bytes(one.endpoint_gid) for one in publishers if node_name(one) == node)

    def _node_of(self, info: Any) -> str:
        """Return the name of the node that published a message of diagnostics; empty if it is not known."""
        gid, topic, names = info.get("publisher_gid"), self.config.topics.diagnostics, self._diagnosing
        if not gid or topic is None:
            return ""
        key = bytes(gid["data"])
        if key not in names:
            names.update(
                (bytes(one.endpoint_gid), node_name(one)) for one in self.graph.publishers(topic.name)
            )
            while len(names) > MOST_NODES:
                del names[next(iter(names))]
        return names.get(key, "")

    # --- the drive topic --------------------------------------------------------------------------------

    def _connect(self, use: Use, topics: frozenset[str]) -> None:
        if use == "drive":
            self._driven = topics
            self._connect_drives()
        elif use == "speech" and (voices := self.part(Voices)):
            voices.attend(topics)

    def _follow_kind(self) -> None:
        """Send velocities of the type that the robot takes on the topic to which they go."""
        drive = structs.replace(self.config.topics.drive, name=self._inputs.drive)
        self._twist = wanted_kind(self.graph, drive, self._twist)
        if not self._drives.are(self._driven, self._twist):
            self._topic_worker.do(self._connect_drives)

    def _connect_drives(self) -> None:
        """Connect to the topics of velocities. A zero that came meanwhile may have reached nobody: repeat it."""
        sent = self._drives.sent
        for publisher in self._drives.connect(self.participant.node, self._driven, self._twist):
            self._await_listener(publisher)
            missed = publisher is self._drive and self._drives.sent != sent
            if missed and self._drives.newest == STILL:
                publish_still(publisher)

    def _await_listener(self, publisher: Any) -> None:
        """Wait a moment for a listener: otherwise a robot with a new drive topic would look disconnected."""
        deadline_s = time.monotonic() + LISTENER_PATIENCE_S
        while not publisher.get_subscription_count() and time.monotonic() < deadline_s:
            time.sleep(FLUSH_S / 10)


if TYPE_CHECKING:
    SIDE: Callable[[BridgeConfig], RobotSide] = RosBase
