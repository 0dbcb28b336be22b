"""All families of operations. One more is one line here."""

from __future__ import annotations

from teleop.rosbridge.actions.action_goals import ActionGoals
from teleop.rosbridge.clients.services import ClientServices
from teleop.rosbridge.clients.topics import ActionTopics
from teleop.rosbridge.control_services import ControlServices
from teleop.rosbridge.family import Family
from teleop.rosbridge.publishing import Publishing
from teleop.rosbridge.robot_services import RobotServices
from teleop.rosbridge.service_calls import ServiceCalls
from teleop.rosbridge.subscribing import Subscribing
from teleop.rosbridge.tf.republisher import Transforms

FAMILIES: tuple[type[Family], ...] = (
    Publishing,
    Subscribing,
    ControlServices,
    RobotServices,
    ActionGoals,
    ClientServices,
    ActionTopics,
    Transforms,
    ServiceCalls,
)
