"""Steps of scripts on an unchanged roslibpy, one after the other. Run by `test_rosbridge.py`: address, then tokens.

Each step checks what its client sees, and prints its name.
"""

from __future__ import annotations

import base64
import math
import queue
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import roslibpy
from roslibpy.core import ServiceException
from roslibpy.ros1 import actionlib
from roslibpy.tf import TFClient
from twisted.internet import reactor

ADDRESS, OPERATOR, STAFF, OBSERVER = sys.argv[1:]
ANSWER_S = 40.0


class Inbox:
    """The messages of one topic."""

    def __init__(self, ros: roslibpy.Ros, name: str, type_: str, **options: Any) -> None:
        self.topic = roslibpy.Topic(ros, name, type_, **options)
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.topic.subscribe(self._queue.put)

    def until(self, fits: Callable[[Any], Any] = lambda _: True) -> Any:
        deadline_s = time.monotonic() + ANSWER_S
        while time.monotonic() < deadline_s:
            message = self._queue.get(timeout=ANSWER_S)
            if fits(message):
                return message
        raise AssertionError(f"no such message on {self.topic.name}")


def connected(token: str) -> roslibpy.Ros:
    ros = roslibpy.Ros(ADDRESS, headers={"Authorization": f"Bearer {token}"})
    ros.run()
    ros.set_status_level("none", None)  # roslibpy logs an exception for each status
    return ros


def call(ros: roslibpy.Ros, name: str, **fields: Any) -> Any:
    return roslibpy.Service(ros, name, "").call(fields, timeout=ANSWER_S)


def refused(ros: roslibpy.Ros, name: str, **fields: Any) -> str:
    try:
        return f"not refused: {call(ros, name, **fields)}"
    except ServiceException as error:
        return str(error)


def told_why_without_control() -> None:
    told = Inbox(operator, "/fleet/status", "fleet/Status")
    drive.publish({"linear": {"x": 0.2}})
    assert told.until()["msg"].startswith("no_lease: ")
    assert refused(observer, "/fleet/take_control").startswith("role_too_low: "), refused(
        observer, "/fleet/take_control"
    )
    told.topic.unsubscribe()


def asks_about_the_robot() -> None:
    assert "/scan_raw" in operator.get_topics()
    assert operator.get_topic_type("/scan_raw") == "sensor_msgs/LaserScan"
    assert "/scan_raw" in operator.get_topics_for_type("sensor_msgs/LaserScan")
    assert operator.get_service_type("/play_motion/list_motions") == "play_motion_msgs/ListMotions"
    assert "/play_motion/list_motions" in operator.get_services_for_type("play_motion_msgs/ListMotions")
    node = next(node for node in operator.get_nodes() if node.startswith("/simulator"))
    assert "/scan_raw" in operator.get_node_details(node)["publishing"]
    assert operator.get_message_details("geometry_msgs/Twist")["typedefs"][1]["fieldnames"] == ["x", "y", "z"]
    assert (
        operator.get_service_response_details("std_srvs/SetBool")["typedefs"][0]["fieldnames"][0] == "success"
    )
    assert abs(operator.get_time()["secs"] - time.time()) < 5
    assert operator.get_param("/robot_description").startswith("<robot")
    servers: queue.SimpleQueue[Any] = queue.SimpleQueue()
    operator.get_action_servers(servers.put)
    assert "/play_motion" in servers.get(timeout=ANSWER_S)["action_servers"]


def drives_at_100_hz() -> None:
    odometry = Inbox(operator, "/mobile_base_controller/odom", "nav_msgs/Odometry")
    begin = odometry.until()["pose"]["pose"]["position"]
    assert call(operator, "/fleet/take_control")["state"] == "yours"
    ended = threading.Event()

    def publish() -> None:
        while not ended.wait(0.01):
            drive.publish({"angular": {"z": 0.5}, "linear": {"x": 0.1}})

    publisher = threading.Thread(target=publish)
    publisher.start()
    try:
        odometry.until(lambda message: math.dist(place(message), (begin["x"], begin["y"])) > 0.1)
    finally:
        ended.set()
        publisher.join()
    odometry.until(lambda message: abs(message["twist"]["twist"]["linear"]["x"]) < 0.01)
    odometry.topic.unsubscribe()


def place(message: Any) -> tuple[float, float]:
    at = message["pose"]["pose"]["position"]
    return at["x"], at["y"]


def publishes_and_reads() -> None:
    notes = Inbox(observer, "/fleet_demo/notes", "std_msgs/String")
    sender = roslibpy.Topic(operator, "/fleet_demo/notes", "std_msgs/String")
    ended = threading.Event()

    def publish() -> None:  # until the reader is connected to the publisher
        while not ended.wait(0.1):
            sender.publish({"data": "Grüß Gott"})

    threading.Thread(target=publish).start()
    assert notes.until()["data"] == "Grüß Gott"
    ended.set()
    notes.topic.unsubscribe()
    sender.unadvertise()


def performs_actions_in_both_styles() -> None:
    client = actionlib.ActionClient(operator, "/tts", "pal_interaction_msgs/TtsAction")
    feedback: list[Any] = []
    goal = actionlib.Goal(client, {"rawtext": {"text": "One two three", "lang_id": "en_GB"}})
    goal.on("feedback", feedback.append)
    goal.send()
    assert goal.wait(ANSWER_S)["text"] == "One two three"
    assert goal.status["status"] == actionlib.GoalStatus.SUCCEEDED
    assert feedback
    goal = actionlib.Goal(client, {"rawtext": {"text": "A long sentence " * 20, "lang_id": "en_GB"}})
    running = threading.Event()
    goal.on("status", lambda status: status["status"] == actionlib.GoalStatus.ACTIVE and running.set())
    goal.send()
    assert running.wait(ANSWER_S)
    goal.cancel()
    goal.wait(ANSWER_S)
    assert goal.status["status"] == actionlib.GoalStatus.PREEMPTED
    client.dispose()
    ends: queue.SimpleQueue[Any] = queue.SimpleQueue()
    motion = roslibpy.ActionClient(operator, "/play_motion", "play_motion_msgs/PlayMotionAction")
    for name in ("home", "nonsense"):
        id_ = motion.send_goal(roslibpy.Goal({"motion_name": name}), ends.put, print, ends.put)
        motion.wait_goal(id_, 3 * ANSWER_S)
    assert ends.get()["status"] == roslibpy.GoalStatus.SUCCEEDED
    assert ends.get()["values"].startswith("unknown_motion: ")


def follows_a_frame() -> None:
    frames = TFClient(observer, fixed_frame="odom", angular_threshold=0.01, rate=10.0)
    heard: queue.SimpleQueue[Any] = queue.SimpleQueue()
    frames.subscribe("base_footprint", heard.put)
    assert set(heard.get(timeout=ANSWER_S)) == {"translation", "rotation"}
    frames.dispose()


def reads_a_map_and_a_picture() -> None:
    map_ = Inbox(observer, "/map", "nav_msgs/OccupancyGrid").until()
    assert len(map_["data"]) == map_["info"]["width"] * map_["info"]["height"]
    picture = Inbox(
        observer, "/xtion/rgb/image_raw/compressed", "sensor_msgs/CompressedImage", throttle_rate=500
    )
    assert base64.b64decode(picture.until()["data"]).startswith(b"\xff\xd8")
    picture.topic.unsubscribe()


def offers_a_service() -> None:
    def add(request: Any, response: Any) -> bool:
        response["sum"] = request["a"] + request["b"]
        return True

    service = roslibpy.Service(operator, "/add_two_ints", "rospy_tutorials/AddTwoInts")
    service.advertise(add)
    call(operator, "/rosapi/get_time")  # its answer comes after the offer
    assert call(staff, "/fleet/clients/add_two_ints", a=2, b=3) == {"sum": 5}
    service.unadvertise()


def offers_an_action() -> None:
    fibonacci = "/fleet/clients/fibonacci", "actionlib_tutorials/FibonacciAction"
    server = actionlib.SimpleActionServer(operator, *fibonacci)

    def execute(goal: Any) -> None:
        server.send_feedback({"sequence": [0, 1]})
        if goal["order"] < 10:
            server.set_succeeded({"sequence": [0, 1, 1, 2]})
            return
        while not server.is_preempt_requested():
            time.sleep(0.02)
        server.set_preempted()

    server.start(execute)
    client = actionlib.ActionClient(staff, *fibonacci)
    goal = actionlib.Goal(client, {"order": 3})
    goal.send()
    assert goal.wait(ANSWER_S)["sequence"] == [0, 1, 1, 2]
    assert goal.feedback["sequence"] == [0, 1]
    goal = actionlib.Goal(client, {"order": 20})
    begun = threading.Event()
    goal.on("feedback", lambda _: begun.set())
    goal.send()
    assert begun.wait(ANSWER_S)
    goal.cancel()
    ended = threading.Event()
    goal.on("status", lambda status: status["status"] == actionlib.GoalStatus.PREEMPTED and ended.set())
    assert ended.wait(ANSWER_S)


def reconnects() -> None:
    notes = Inbox(operator, "/scan_raw", "sensor_msgs/LaserScan", throttle_rate=200)
    notes.until()
    lost = threading.Event()
    operator.on("close", lambda _: lost.set())
    reactor.callFromThread(operator.factory.connector.transport.abortConnection)  # as when the network fails
    assert lost.wait(ANSWER_S)
    while not operator.is_connected:
        time.sleep(0.05)
    notes.until()
    notes._queue = queue.SimpleQueue()
    assert refused(operator, "/fleet/renew_control").startswith("no_lease: ")


def staff_call_services_and_set_parameters() -> None:
    assert refused(staff, "/play_motion/list_motions").startswith("no_lease: ")
    assert call(staff, "/fleet/take_control")["state"] == "yours"
    assert "wave" in {motion["name"] for motion in call(staff, "/play_motion/list_motions")["motions"]}
    assert refused(staff, "/gripper_controller/grasp").startswith("not_allowed: ")
    staff.set_param("/fleet_demo/greeting", {"words": ["hello", 5, True]})
    assert staff.get_param("/fleet_demo/greeting") == {"words": ["hello", 5, True]}
    staff.delete_param("/fleet_demo/greeting")
    assert staff.get_param("/fleet_demo/greeting") is None
    call(staff, "/fleet/release_control")


operator, staff, observer = (connected(token) for token in (OPERATOR, STAFF, OBSERVER))
drive = roslibpy.Topic(operator, "/cmd_vel", "geometry_msgs/Twist")
for step in (
    asks_about_the_robot,
    told_why_without_control,
    drives_at_100_hz,
    publishes_and_reads,
    performs_actions_in_both_styles,
    follows_a_frame,
    reads_a_map_and_a_picture,
    offers_a_service,
    offers_an_action,
    reconnects,
    staff_call_services_and_set_parameters,
):
    began_s = time.monotonic()
    step()
    print(f"{step.__name__} {time.monotonic() - began_s:.1f} s", flush=True)
operator.terminate()
