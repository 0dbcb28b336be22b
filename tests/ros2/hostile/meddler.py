"""A stranger who calls all that nodes usually serve: ``python -m tests.ros2.hostile.meddler NODE...``.

It prints what each of these nodes serves, as far as the domain tells, and which calls were answered.
"""

import robots.bridge.ros2  # noqa: F401, I001  (first: makes rclpy importable)

import os
import sys
import threading
import time
from contextlib import suppress
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rcl_interfaces import srv
from rcl_interfaces.msg import LoggerLevel, Parameter, ParameterType, ParameterValue
from rclpy.executors import ExternalShutdownException
from type_description_interfaces.srv import GetTypeDescription

PATIENCE_S, FOUND_S, ANSWER_S = 15.0, 0.01, 1.0
SIMULATED = Parameter(
    name="use_sim_time", value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
)
ENDS = Transition(id=Transition.TRANSITION_ACTIVE_SHUTDOWN)
NAMED = {"names": ["use_sim_time"]}
ASKED: dict[str, tuple[Any, dict[str, Any]]] = {
    "set_parameters": (srv.SetParameters, {"parameters": [SIMULATED]}),
    "set_parameters_atomically": (srv.SetParametersAtomically, {"parameters": [SIMULATED]}),
    "get_parameters": (srv.GetParameters, NAMED),
    "get_parameter_types": (srv.GetParameterTypes, NAMED),
    "describe_parameters": (srv.DescribeParameters, NAMED),
    "list_parameters": (srv.ListParameters, {}),
    "set_logger_levels": (srv.SetLoggerLevels, {"levels": [LoggerLevel(name="", level=50)]}),
    "get_logger_levels": (srv.GetLoggerLevels, {}),
    "change_state": (ChangeState, {"transition": ENDS}),
    "get_state": (GetState, {}),
    "get_available_states": (GetAvailableStates, {}),
    "get_available_transitions": (GetAvailableTransitions, {}),
    "get_type_description": (GetTypeDescription, {"type_name": "geometry_msgs/msg/Twist"}),
}


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("meddler")
    until_s = time.monotonic() + PATIENCE_S
    for name in sys.argv[1:]:
        while name not in node.get_node_names() and time.monotonic() < until_s:
            time.sleep(0.02)  # DDS tells nobody

    def spin() -> None:
        with suppress(ExternalShutdownException):
            rclpy.spin(node)

    threading.Thread(target=spin, daemon=True).start()
    answers = {}
    for name in sys.argv[1:]:
        for service, (kind, fields) in ASKED.items():
            client = node.create_client(kind, f"/{name}/{service}")
            client.wait_for_service(FOUND_S)
            answers[f"/{name}/{service}"] = client.call_async(kind.Request(**fields))
    time.sleep(ANSWER_S)
    for name in sys.argv[1:]:
        served = node.get_service_names_and_types_by_node(name, "/")
        print("serves", name, *(service for service, _ in served), flush=True)
    print("answered", *(service for service, answer in answers.items() if answer.done()), flush=True)
    sys.stdin.read()
    os._exit(0)


if __name__ == "__main__":
    main()
