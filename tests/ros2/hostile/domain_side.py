"""Parts of the console in one process with strangers: ``… SCENARIO`` prints a line for each thing that it has seen."""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import ctypes
import os
import resource
import sys
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from msgspec.structs import replace
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import String

from robots.bridge.robot.board import BOARD
from robots.bridge.ros2 import raw_topic
from robots.bridge.ros2.drive import kind_of
from robots.bridge.ros2.followed import FollowedTopics
from robots.bridge.ros2.inspector.node import Source
from robots.bridge.ros2.message_types import message_class
from robots.bridge.ros2.network.graph import UNNAMED, Graph
from robots.bridge.ros2.network.survey import Listeners, is_there, wanted_kind
from robots.bridge.ros2.node import RosBase
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import DRIVE, kept, pictures, sensor
from robots.bridge.ros2.raw_topic import RawTopics
from robots.bridge.ros2.tasks import actions as our_actions
from robots.bridge.ros2.tasks.actions import ActionEnds, GoalListener
from robots.bridge.ros2.tasks.cancels import CANCEL, MOST_ACTIONS, MOST_LOOKED_UP, Cancels
from robots.bridge.ros2.watchdog import WatchdogNode
from robots.shared.configuration.bridge_config import Topic, drive_topic
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import WatchdogConfig
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.texts import MOST_NODES
from tests.bridge.support import CONFIG
from tests.ros2.hostile.stranger import leave, member

DOMAIN = int(os.environ["ROS_DOMAIN_ID"])
ACTION, KIND = "/play_motion2", "play_motion2_msgs/action/PlayMotion2"
PLAIN, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
DRIVE_TOPIC = drive_topic("/key_vel", PLAIN, 2)
PATIENCE_S = 15.0
EXECUTING, SUCCEEDED = 2, 4
KEPT = DurabilityPolicy.TRANSIENT_LOCAL


def tell(*words: object) -> None:
    print(*words, flush=True)


def until(condition: Callable[[], Any], what: str) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > until_s:
            tell("never:", what)
            os._exit(1)
        time.sleep(0.02)


# --- actions --------------------------------------------------------------------------------------


class Server:
    """An action server that accepts each goal, says that it runs, and answers as told: never, or `times`."""

    def __init__(self, times: int) -> None:
        self.node, kind = member("play_motion2"), message_class(KIND)
        self._times = times
        self.cancelled: list[bool] = []  # whether it was the last goal
        services = {
            "send_goal": (kind.Impl.SendGoalService, self._accept),
            "get_result": (kind.Impl.GetResultService, self._answer),
            "cancel_goal": (CancelGoal, self._cancel),
        }
        for name, (service, take) in services.items():
            group = ReentrantCallbackGroup()  # a result that never comes keeps no cancel away
            made = self.node.create_service(service, f"{ACTION}/_action/{name}", take, callback_group=group)
            send = made.send_response
            made.send_response = lambda *answer, send=send: [send(*answer) for _ in range(times or 1)]
        self._status = self.node.create_publisher(
            GoalStatusArray, f"{ACTION}/_action/status", QoSProfile(depth=1, durability=KEPT)
        )
        self._executor = SingleThreadedExecutor(context=self.node.context)
        self._executor.add_node(self.node)
        self._dies = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._dies.is_set():
            self._executor.spin_once(0.1)

    def _accept(self, request: Any, answer: Any) -> Any:
        self._goal = request.goal_id
        self.says(EXECUTING)
        answer.accepted = True
        return answer

    def _cancel(self, request: Any, answer: Any) -> Any:
        self.cancelled.append(request.goal_info.goal_id == self._goal)
        return answer

    def says(self, status: int, instead: Any = None) -> None:
        """Tell the status of the last goal, or let another publisher tell it."""
        said = GoalStatus(status=status)
        said.goal_info.goal_id = self._goal
        (instead or self._status).publish(GoalStatusArray(status_list=[said]))

    async def _answer(self, _request: Any, answer: Any) -> Any:
        if not self._times:
            await Future()
        answer.status = SUCCEEDED
        return answer

    def die(self) -> None:
        self._dies.set()
        self._thread.join()
        leave(self.node)


class Seen(GoalListener):
    def __init__(self) -> None:
        self.goals: dict[str, int] = {}
        self.ends: list[tuple[str, str]] = []
        self.told = 0  # times

    def running(self, action: str, goals: dict[str, int]) -> None:
        self.goals = dict(goals)
        self.told += 1

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self.ends.append((goal_id, outcome))


def actions(participant: Participant) -> None:
    seen = Seen()
    ends = ActionEnds(participant, Topic(ACTION, KIND), seen)
    participant.start()
    silent = Server(0)
    until(lambda: ends.heard, "the server")
    ends.send("first", ends.goal_class(motion_name="wave"))
    until(lambda: seen.goals == {"first": EXECUTING}, "a goal that runs")
    tell("runs")
    another = Server(2)  # comes before the first one leaves: the action is always served
    status = f"{ACTION}/_action/status"
    until(lambda: participant.node.count_publishers(status) == 2, "the second server")
    silent.die()
    until(lambda: not seen.goals, "that the goal of a server that has gone is forgotten")
    tell("forgotten", *seen.ends)
    for goal in ("second", "third"):
        ends.send(goal, ends.goal_class(motion_name="wave"))
        until(lambda goal=goal: (goal, "succeeded") in seen.ends, goal)
    tell("ended", *(goal for goal, _ in seen.ends))
    another.die()
    until(lambda: not ends.heard, "that nobody serves")
    lost = Server(0)
    until(lambda: ends.heard, "a server whose results are lost")
    ends.send("fourth", ends.goal_class(motion_name="wave"))
    until(lambda: seen.goals == {"fourth": EXECUTING}, "a goal that runs")
    our_actions.RESULT_S = 0.1
    profile = QoSProfile(depth=1, durability=KEPT)
    strange = member("stranger").create_publisher(GoalStatusArray, status, profile)
    lost.says(SUCCEEDED, strange)
    until(lambda: len(ends._said) == 2, "what the stranger says")
    repeated = seen.told + 2
    until(lambda: seen.told > repeated, "a repeat")
    tell("runs", *seen.goals, lost.cancelled)
    lost.says(SUCCEEDED)
    until(lambda: ("fourth", "succeeded") in seen.ends, "its end by its status")
    tell("ended", *(goal for goal, _ in seen.ends))
    until(lambda: lost.cancelled == [True], "its cancel")
    tell("cancelled")
    lost.die()


# --- types and QoS --------------------------------------------------------------------------------


def versions(participant: Participant) -> None:
    """A type with a further field, in front. The digest that rclpy tells lies in the memory of its library."""
    heard: list[bytes] = []
    participant.listen("/words", "std_msgs/msg/String", lambda raw, _: heard.append(raw), sensor(1))
    participant.start()
    library = ctypes.CDLL("libstd_msgs__rosidl_generator_c.so")
    digest = library.std_msgs__msg__String__get_type_hash
    digest.restype, digest.argtypes = ctypes.POINTER(ctypes.c_uint8), [ctypes.c_void_p]
    newer = digest(None)
    newer[1] ^= 0xFF
    node = member("newer")
    publisher = node.create_publisher(String, "/words", 1)
    newer[1] ^= 0xFF
    message = b"\0\1\0\0" + b"\7\0\0\0" + b"\4\0\0\0abc\0"
    until(publisher.get_subscription_count, "that DDS connects the two")

    def said() -> list[str]:
        publisher.publish(message)
        return BOARD.texts()

    until(lambda: [text for text in said() if "/newer" in text], "what is said of it")
    tell("said", *BOARD.texts())
    tell("heard", len(heard))
    honest = member("honest").create_publisher(String, "/words", 1)
    until(lambda: (honest.publish(String(data="abc")), heard)[1], "the other one")
    tell("heard", *{raw.hex() for raw in heard})


def qos(participant: Participant) -> None:
    """Pictures of a publisher that offers less than before; a message that stays, beside a stranger's."""
    heard: list[str] = []
    graph = Graph(participant.node)
    followed = FollowedTopics(participant, graph)

    def take(raw: bytes, _info: Any) -> None:
        heard.append(raw[8:].rstrip(b"\0").decode())

    participant.start()
    for word, reliability in (
        ("sure", ReliabilityPolicy.RELIABLE),
        ("fast", ReliabilityPolicy.BEST_EFFORT),
        ("sure again", ReliabilityPolicy.RELIABLE),
    ):
        camera = member("camera")
        publisher = camera.create_publisher(String, "/pictures", QoSProfile(depth=1, reliability=reliability))
        if word == "sure":
            until(lambda: graph.publishers("/pictures"), word)
            followed.listen("/pictures", "std_msgs/msg/String", take, pictures)

        def comes(publisher: Any = publisher, word: str = word) -> bool:
            publisher.publish(String(data=word))
            followed.follow()
            return word in heard

        until(comes, word)
        tell("heard", word)
        leave(camera)
    node = member("keeps")
    node.create_publisher(String, "/kept", QoSProfile(depth=1, durability=KEPT)).publish(String(data="kept"))
    strange = member("stranger")
    strange.create_publisher(String, "/kept", 1)
    fast = QoSProfile(depth=1, durability=KEPT, reliability=ReliabilityPolicy.BEST_EFFORT)
    strange.create_publisher(String, "/kept", fast)
    until(lambda: len(graph.publishers("/kept")) == 3, "all")
    followed.listen("/kept", "std_msgs/msg/String", take, kept)
    until(lambda: (followed.follow(), "kept" in heard)[1], "what stays")
    tell("heard", "kept")


# --- who listens ----------------------------------------------------------------------------------


def kinds(participant: Participant) -> None:
    """A stranger listens to velocities of the type that is entered, the robot to the other; then both leave."""
    graph, node, now = Graph(participant.node), member("base"), PLAIN
    node.create_subscription(TwistStamped, "/key_vel", print, 1)
    until(lambda: wanted_kind(graph, DRIVE_TOPIC, now) == STAMPED, "what the robot takes")
    now = STAMPED
    stranger = member("stranger")
    stranger.create_subscription(Twist, "/key_vel", print, 1)
    until(lambda: len(graph.subscribers("/key_vel")) == 2, "both")
    tell("kind", wanted_kind(graph, DRIVE_TOPIC, now))
    leave(stranger)
    stranger = member("crowd")
    for _ in range(MOST_NODES):
        stranger.create_subscription(Twist, "/key_vel", print, 1)
    until(lambda: graph.is_crowded("/key_vel"), "a crowd")
    tell("kind", wanted_kind(graph, DRIVE_TOPIC, now))
    tell("there", is_there(graph, replace(CONFIG.topics, drive=DRIVE_TOPIC), "/key_vel"))
    leave(stranger)
    leave(node)
    member("another").create_subscription(Twist, "/key_vel", print, 1)
    until(lambda: wanted_kind(graph, DRIVE_TOPIC, now) == PLAIN, "what another robot takes")


def unfit(participant: Participant) -> None:
    """Listeners that DDS does not connect beside the robot's: of the console by name; too new to have a name."""
    member("base").create_subscription(Twist, "/key_vel", print, 1)
    publisher = participant.node.create_publisher(Twist, "/key_vel", DRIVE)
    graph, kept_qos = Graph(participant.node), QoSProfile(depth=1, durability=KEPT)
    until(lambda: len(graph.subscribers("/key_vel")) == 1, "the robot")
    until(publisher.get_subscription_count, "that DDS connects the two")
    member("fleet_bridge_x").create_subscription(Twist, "/key_vel", print, kept_qos)
    until(lambda: len(graph.subscribers("/key_vel")) == 2, "the stranger")
    tell("listeners", Listeners(graph).of("/key_vel", publisher))
    names, node = participant.node.get_subscriptions_info_by_topic, participant.node

    def without_names(topic: str) -> Any:
        for one in (found := names(topic)):
            if one.node_name != "base":
                one.node_name = UNNAMED
        return found

    node.get_subscriptions_info_by_topic = without_names  # the moment in which a name is not known is short
    tell("listeners", Listeners(Graph(node)).of("/key_vel", publisher))


def crowd(participant: Participant) -> None:
    """So many publishers of a topic and of an action's status that a look at them would take long."""
    node, looked, heard, seen = participant.node, [], [], Seen()
    look = node.get_publishers_info_by_topic
    node.get_publishers_info_by_topic = lambda topic: looked.append(topic) or look(topic)
    participant.listen("/words", "std_msgs/msg/String", lambda raw, _: heard.append(raw), sensor(1))
    ends, server = ActionEnds(participant, Topic(ACTION, KIND), seen), Server(0)
    participant.start()
    until(lambda: ends.heard, "the server")
    ends.send("first", ends.goal_class(motion_name="wave"))
    status = f"{ACTION}/_action/status"
    until(lambda: status in looked, "a look at the servers")
    strangers = member("crowd")
    for _ in range(MOST_NODES + 1):
        strangers.create_publisher(GoalStatusArray, status, 1)
        words = strangers.create_publisher(String, "/words", 1)
    until(lambda: min(map(node.count_publishers, ("/words", status))) > MOST_NODES, "the crowd")
    repeated = seen.told + 1
    until(lambda: seen.told > repeated, "the look that had begun")
    looked.clear()
    repeated = seen.told + 1
    until(lambda: (words.publish(String(data="a")), heard and seen.told > repeated)[1], "a word")
    tell("looked", *looked)
    server.die()


def servers(participant: Participant) -> None:
    """More servers of actions than a stop cancels, names without a server, another robot's; then they leave."""
    strange, names = member("strange"), member("names")
    cancels = Cancels(participant.node, ["/configured"], "/lab")
    clients = participant.node._clients

    def look() -> list[str]:
        cancels._due_s = 0.0
        cancels.look()
        return sorted(client.srv_name.removesuffix(CANCEL) for client in clients)

    for number in range(MOST_ACTIONS + 40):
        strange.create_service(CancelGoal, f"/lab/a_{number}{CANCEL}", print)
        if number < MOST_LOOKED_UP - 40:  # with more, a look says that it may have missed a server
            names.create_client(CancelGoal, f"/lab/b_{number}{CANCEL}")
    strange.create_service(CancelGoal, f"/other/c{CANCEL}", print)
    until(lambda: len(look()) > MOST_ACTIONS, "servers")
    until(lambda: (look(), cancels.is_full)[1], "that there are more")
    before = look()
    tell("found", len(before), *{action.rpartition("_")[0] for action in before})
    member("late").create_service(CancelGoal, f"/lab/a_late{CANCEL}", print)
    until(lambda: participant.node.count_services(f"/lab/a_late{CANCEL}"), "one more")
    tell("stay", look() == before)
    leave(strange)
    until(lambda: look() == ["/configured", "/lab/a_late"], "that the places are free")
    tell("left", cancels.is_full)


def heard_by(name: str, kind: Any, topic: str = "/key_vel") -> list[float]:
    """Return the speeds that such a node hears from now on."""
    heard: list[float] = []
    node = member(name)
    node.create_subscription(
        kind, topic, lambda twist: heard.append(getattr(twist, "twist", twist).linear.x), 10
    )
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    return heard


def switch(participant: Participant) -> None:
    """The robot takes another type: not while it is driven, and a stop meanwhile reaches it."""
    node, topics = participant.node, replace(CONFIG.topics, drive=DRIVE_TOPIC)
    base = RosBase(replace(CONFIG, ros=Ros2(DOMAIN, "localhost"), topics=topics))
    base.participant = participant
    base._reception.core = SimpleNamespace(clocks_agree=True)
    base._connect_drives()
    before, robot = heard_by("fleet_tap_1", Twist), heard_by("base", TwistStamped)
    until(base._drive.get_subscription_count, "that DDS connects the two")
    until(lambda: len(Graph(node).subscribers("/key_vel")) == 2, "the robot")
    base._twist = STAMPED
    base.publish(Velocity(0.5, 0.0, 0.0))
    until(lambda: before, "the first velocity")
    base._connect_drives()
    tell("driven", kind_of(base._drive))
    base.publish(Velocity(0.25, 0.0, 0.0))
    until(lambda: 0.25 in before, "that the old publisher goes on")
    tell("heard", *before)
    base._drives.newest = STILL
    destroy = node.destroy_publisher

    def stop_meanwhile(publisher: Any) -> None:
        base.publish(STILL)
        destroy(publisher)

    node.destroy_publisher = stop_meanwhile
    base._connect_drives()
    tell("stands", kind_of(base._drive))
    until(lambda: robot and 0.0 in before, "both zeros")
    tell("heard", *before, *robot)


def slow(_participant: Participant) -> None:
    """A look at the domain's actions takes long, and the watchdog's drive topic changes meanwhile."""
    begun, over = threading.Event(), threading.Event()
    Cancels.look = lambda _: (begun.set(), over.wait())
    config = WatchdogConfig(
        uuid4(), "tiago", Ros2(DOMAIN, "localhost"), "/fleet_watchdog_0", DRIVE_TOPIC, (), "", ""
    )
    watchdog = WatchdogNode(config)
    watchdog.start()
    assert begun.wait(PATIENCE_S)
    heard = heard_by("base", Twist, "/chosen_vel")
    watchdog.drive_to("/chosen_vel")
    until(lambda: (watchdog.zero(), heard)[1], "a zero on the chosen topic")
    tell("heard", *set(heard))
    over.set()


# --- floods ---------------------------------------------------------------------------------------


def resident() -> int:
    """Memory of this process (MB)."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * resource.getpagesize() // 1_000_000


def flood(_participant: Participant) -> None:
    """A reader that is slower than a flood of large messages."""
    came, over = threading.Event(), threading.Event()

    def take(_speaker: Any, _data: bytes) -> None:
        came.set()
        over.wait()

    raw = RawTopics(replace(CONFIG, ros=Ros2(DOMAIN, "localhost")), "/fleet_recorder")
    raw.listen("/strings", take, 100)
    assert came.wait(PATIENCE_S)
    before = resident()
    time.sleep(float(sys.argv[2]))
    tell("grown", resident() - before)
    over.set()


def often(participant: Participant) -> None:
    """Messages that come at once: the inspector, which counts them, does not let any wait."""
    slept: list[float] = []
    raw_topic.time = SimpleNamespace(monotonic=lambda: 1.0, sleep=slept.append)
    thinned = raw_topic.RawTopic(participant, "/words", lambda *_: None, 1)
    for topic in (thinned, Source(participant, "/words", lambda _: None)._topic):
        for _ in range(3):
            topic._receive("std_msgs/msg/String", b"", {})
        tell("slept", len(slept))
        slept.clear()


def main() -> None:
    scenario = globals()[sys.argv[1]]
    scenario(Participant("fleet_try", DOMAIN))
    tell("over")
    os._exit(0)


if __name__ == "__main__":
    main()
