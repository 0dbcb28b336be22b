"""rosapi answers as in ROS 1, from what the inspector says."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest

from robots.shared import wire
from robots.shared.wire import Described, Field, NotDone, Refusal, Refused
from teleop.rosbridge.rosapi.answers import SERVICES, Rosapi
from teleop.rosbridge.rosapi.typedefs import typedefs

GRAPH = wire.Graph(
    [
        wire.TopicRow("/odom", "nav_msgs/Odometry", ["/base"], ["/gui"]),
        wire.TopicRow("/say", "std_msgs/String", [], ["/voice"]),
        wire.TopicRow("/secret", "*", ["/base"], []),
    ],
    [wire.ActionRow("/move_base", "move_base_msgs/MoveBaseAction")],
    [wire.ServiceRow("/base/reset", "/base"), wire.ServiceRow("/lamp", "/voice")],
)
TYPES = {"/base/reset": "std_srvs/Empty", "/lamp": "std_srvs/SetBool"}
TEXT = """\
uint8 SUN=0   # bright
string NAME=a # b
time stamp
Station[] stations
float32[3] hourly
================================================================================
MSG: lab_msgs/Station
string name
"""
STATION = [Field("name", "string")]
WEATHER = wire.Described(
    "lab_msgs/Weather",
    "0" * 32,
    [
        Field("stamp", "time"),
        Field("stations", "lab_msgs/Station", -1, {}, STATION),
        Field("hourly", "float32", 3),
    ],
    TEXT,
)


class Robot:
    """An inspector that knows the constants above."""

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.parameters: dict[str, Any] = {"/volume": 50, "/kitchen/oven": True}

    async def query(self, query: Any) -> str:
        self.asked.append(query)
        return wire.encode(self.answer(query)).decode()

    def answer(self, query: Any) -> Any:
        match query:
            case wire.ListTopics():
                return GRAPH
            case wire.ListServiceTypes(services=names):
                return wire.ServiceTypes({name: TYPES[name] for name in names or TYPES if name in TYPES})
            case wire.LocateService(service=name):
                return wire.ServiceHost("tiago-1c" if name in TYPES else "")
            case wire.ListDefinitions():
                return wire.Definitions({"std_msgs/String": "string data"})
            case wire.Describe(type="lab_msgs/Weather") | wire.DescribeServiceType(type="lab_msgs/Weather"):
                return WEATHER
            case wire.ListParameters():
                return wire.Parameters(sorted(self.parameters))
            case wire.GetParameter(name=name) | wire.DeleteParameter(name=name) if (
                name not in self.parameters
            ):
                return Refused("parameter", Refusal("no_parameter", "No.", "robot"))
            case wire.GetParameter(name=name):
                return wire.Parameter(name, self.parameters[name])
            case wire.SetParameter(name=name, value=value):
                self.parameters[name] = value
                return wire.Parameter(name, value)
            case wire.DeleteParameter(name=name):
                del self.parameters[name]
                return wire.Parameter(name, None)
            case wire.GetTime():
                return wire.RobotTime(5, 7)
        return Refused("describe", Refusal("type_unknown", "No such type.", "robot"))


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture
def ask(robot: Robot) -> Any:
    own = {"/fleet/take_control": "std_srvs/Trigger"}
    rosapi = Rosapi(robot.query, robot.query, lambda: own, lambda: ["/fleet/clients/count"])

    async def call(service: str, /, **args: Any) -> Any:
        return await rosapi.call(f"/rosapi/{service}", args)

    return call


@pytest.mark.parametrize(
    ("service", "args", "answer"),
    [
        (
            "topics",
            {},
            {"topics": ["/odom", "/say", "/secret"], "types": ["nav_msgs/Odometry", "std_msgs/String", ""]},
        ),
        ("topics_for_type", {"type": "std_msgs/String"}, {"topics": ["/say"]}),
        ("topic_type", {"topic": "/odom"}, {"type": "nav_msgs/Odometry"}),
        ("topic_type", {"topic": "odom"}, {"type": "nav_msgs/Odometry"}),
        ("topic_type", {"topic": "/nothing"}, {"type": ""}),
        ("publishers", {"topic": "/odom"}, {"publishers": ["/base"]}),
        ("subscribers", {"topic": "/odom"}, {"subscribers": ["/gui"]}),
        ("nodes", {}, {"nodes": ["/base", "/gui", "/voice"]}),
        (
            "node_details",
            {"node": "/base"},
            {"subscribing": [], "publishing": ["/odom", "/secret"], "services": ["/base/reset"]},
        ),
        ("service_type", {"service": "/lamp"}, {"type": "std_srvs/SetBool"}),
        ("service_type", {"service": "/rosapi/topics"}, {"type": "rosapi/Topics"}),
        ("service_type", {"service": "/nothing"}, {"type": ""}),
        ("services_for_type", {"type": "std_srvs/Trigger"}, {"services": ["/fleet/take_control"]}),
        ("service_providers", {"service": "std_srvs/SetBool"}, {"providers": ["/voice"]}),
        ("service_node", {"service": "/lamp"}, {"node": "/voice"}),
        ("service_host", {"service": "/lamp"}, {"host": "tiago-1c"}),
        ("service_host", {"service": "/nothing"}, {"host": ""}),
        ("action_servers", {}, {"action_servers": ["/fleet/clients/count", "/move_base"]}),
        ("get_param", {"name": "/volume"}, {"value": "50"}),
        ("get_param", {"name": "kitchen/oven"}, {"value": "true"}),
        ("get_param", {"name": "/nothing"}, {"value": "null"}),
        ("get_param", {"name": "/nothing", "default": "[1]"}, {"value": "[1]"}),
        ("has_param", {"name": "/kitchen"}, {"exists": True}),
        ("has_param", {"name": "/kit"}, {"exists": False}),
        ("search_param", {"name": "volume"}, {"global_name": "/volume"}),
        ("get_param_names", {}, {"names": ["/kitchen/oven", "/volume"]}),
        ("get_time", {}, {"time": {"secs": 5, "nsecs": 7}}),
        ("get_ros_version", {}, {"version": 1, "distro": "noetic"}),
    ],
)
async def test_each_service_answers(service, args, answer, ask):
    assert await ask(service, **args) == answer


async def test_all_services_are_those_of_robot_and_console(ask):
    names = (await ask("services"))["services"]
    assert {"/lamp", "/rosapi/topics", "/fleet/take_control"} <= set(names)
    assert names == sorted(names)


async def test_topics_have_their_definitions(ask):
    assert (await ask("topics_and_raw_types"))["typedefs_full_text"] == ["", "string data", ""]


@pytest.mark.parametrize(
    ("service", "type_"),
    [
        ("message_details", "lab_msgs/Weather"),
        ("message_details", "lab_msgs/msg/Weather"),
        ("service_request_details", "lab_msgs/Weather"),
        ("service_response_details", "lab_msgs/Weather"),
    ],
)
async def test_a_definition_comes_with_the_types_within_it(service, type_, ask):
    weather, time_, station = (await ask(service, type=type_))["typedefs"]
    assert weather == {
        "type": "lab_msgs/Weather",
        "fieldnames": ["stamp", "stations", "hourly"],
        "fieldtypes": ["time", "lab_msgs/Station", "float32"],
        "fieldarraylen": [-1, 0, 3],
        "examples": ["{}", "[]", "[]"],
        "constnames": ["SUN", "NAME"],
        "constvalues": ["0", "a # b"],
    }
    assert (time_["type"], time_["fieldnames"]) == ("time", ["secs", "nsecs"])
    assert (station["fieldnames"], station["examples"]) == (["name"], [""])


async def test_parameters_are_set_from_json_and_deleted(ask, robot):
    assert await ask("set_param", name="/volume", value=json.dumps({"left": 3})) == {}
    assert robot.parameters["/volume"] == {"left": 3}
    assert await ask("delete_param", name="/volume") == {}
    assert "/volume" not in robot.parameters


@pytest.mark.parametrize(
    ("service", "args", "code"),
    [
        ("set_param", {"name": "/volume", "value": "loud"}, "invalid"),
        ("set_param", {"name": "/volume", "value": 5}, "invalid"),
        ("set_param", {"name": "/volume", "value": "[" * 40 + "]" * 40}, "invalid"),
        ("delete_param", {"name": "/nothing"}, "no_parameter"),
        ("get_param", {"name": "no name"}, "invalid"),
        ("get_param", {}, "invalid"),
        ("message_details", {"type": "nobody_msgs/Nothing"}, "type_unknown"),
        ("message_details", {"type": "../etc"}, "invalid"),
        ("topic_type", {"topic": {"a": 1}}, "invalid"),
    ],
)
async def test_what_cannot_be_answered_is_refused_with_a_code(service, args, code, ask):
    with pytest.raises(NotDone) as refused:
        await ask(service, **args)
    assert refused.value.refusal.code == code


async def test_many_questions_about_topics_need_one_list(ask, robot):
    for row in GRAPH.topics:
        await ask("topic_type", topic=row.name)
    assert len([one for one in robot.asked if isinstance(one, wire.ListTopics)]) == 1


async def test_too_many_questions_are_refused(ask, monkeypatch):
    monkeypatch.setattr("robots.shared.link.flood_limits.TokenBucket.spend", lambda *_: False)
    with pytest.raises(NotDone) as refused:
        await ask("get_param", name="/volume")
    assert refused.value.refusal.code == "busy"


async def test_a_failed_list_is_asked_again(ask, robot):
    right, robot.answer = robot.answer, lambda _: Refused("topics", Refusal("robot_offline", "Off.", "robot"))
    with pytest.raises(NotDone):
        await ask("topics")
    robot.answer = right
    assert (await ask("topics"))["topics"]


def test_each_service_has_a_type():
    assert len(SERVICES) == 26


def test_a_text_that_a_publisher_made_for_it_takes_no_time():
    slow = f"int8 SLOW={' ' * 60_000}x\nMSG:{'/' * 60_000} x"
    began_s = time.monotonic()
    (found,) = typedefs(Described("a/B", "", [], f"int8 ONE =  1 # one\nstring WORD = a # b \n{slow}"))
    assert time.monotonic() - began_s < 1.0
    assert found["constnames"] == ["ONE", "WORD", "SLOW"]
    assert found["constvalues"][:2] == ["1", "a # b"]
