"""Is this robot ready to be driven from here? Questions that a lab asks, each with an answer and what to do.

`robots.bridge.ros.probe` finds facts in a process of its own, in the environment of the robot's bridge; `judge` turns
them into answers. The web process never imports ROS.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import msgspec
from django.conf import settings
from msgspec import Struct

from robots.bridge.config import BridgeConfig
from robots.bridge.findings import CallbackFound, DriveFound, Findings, HostFound, Listened, Plan, TopicFound
from robots.described import Problems
from robots.environment import NoWrapper, ros_environment
from robots.models import Robot
from robots.selectors import bridge_config

OK, WARN, FAIL = "ok", "warn", "fail"
PROBE_TIMEOUT_S = 20.0
SKEW_S = 0.5  # above it the robot's and the console's clocks disagree
BRIDGE_NODE = "/fleet_bridge"
NEEDED = ("odometry", "scan")  # kinds without which the robot does not move
QUIET = ("battery", "charging", "speech", "motions")  # may say nothing for long


class Check(Struct, frozen=True):
    """One answer. `level` is ok, warn or fail; `advice` says what to do, "" where nothing is."""

    name: str
    level: str
    text: str
    advice: str = ""


def run_checks(robot: Robot) -> list[Check]:
    """Ask everything; takes a few seconds."""
    try:
        config = bridge_config(robot)
        environment = ros_environment(config, settings.FLEET_RUN_DIR)
    except Problems as problems:
        return [Check("registry", FAIL, str(problems), "Correct the robot's entry or its profile.")]
    except NoWrapper as error:
        return [Check("host aliases", FAIL, str(error), "Install it on the console's computer.")]
    try:
        return [*_elsewhere(robot), *judge(config, _probe(config, environment))]
    except subprocess.TimeoutExpired:
        return [
            Check("probe", FAIL, f"No answer within {PROBE_TIMEOUT_S:g} s.", "Is the network overloaded?")
        ]
    except (subprocess.CalledProcessError, msgspec.DecodeError) as error:
        return [Check("probe", FAIL, f"The probe failed: {error}", "See the console's log.")]


def _elsewhere(robot: Robot) -> Iterator[Check]:
    if robot.bridge_address:
        yield Check(
            "asked from here",
            WARN,
            f"This computer asked, but the robot's bridge runs at {robot.bridge_address}.",
            f"What counts is the answer of manage.py check_robot {robot.slug} on that computer.",
        )


def _probe(config: BridgeConfig, environment: dict[str, str]) -> Findings:
    done = subprocess.run(
        [sys.executable, "-m", "robots.bridge.ros.probe"],
        input=msgspec.json.encode(plan_for(config)),
        stdout=subprocess.PIPE,
        env=environment,
        cwd=settings.BASE_DIR,
        timeout=PROBE_TIMEOUT_S,
        check=True,
    )
    return msgspec.json.decode(done.stdout, type=Findings)


def plan_for(config: BridgeConfig) -> Plan:
    """Everything that the robot's description says is there."""
    return Plan(config.master_uri, config.topics.drive, list(_listened(config)))


def _listened(config: BridgeConfig) -> Iterator[Listened]:
    topics = config.topics
    yield Listened("odometry", topics.odometry.name, topics.odometry.type, stamped=True)
    for scan in topics.scans:
        yield Listened(f"scan {scan.topic}", scan.topic, "sensor_msgs/LaserScan", stamped=True)
    for topic in sorted({sonar.topic for sonar in topics.sonars}):
        frames = [sonar.frame_id for sonar in topics.sonars if sonar.topic == topic]
        yield Listened(f"sonars {topic}", topic, "sensor_msgs/Range", stamped=True, frames=frames)
    if topics.depth:
        yield Listened("depth", topics.depth.topic, topics.depth.type, stamped=True)
    for what in ("joint_states", "camera"):
        if source := getattr(topics, what):
            yield Listened(what.replace("_", " "), source.name, source.type, stamped=True)
    for what in ("battery", "charging"):
        if source := getattr(topics, what):
            yield Listened(what, source.name, source.type, stamped=source.type == "sensor_msgs/BatteryState")
    for what in ("speech", "motions"):
        action = getattr(topics, what)
        if action and action.type.endswith("Action"):  # a plain topic for texts tells nothing
            yield Listened(what, f"{action.name}/result", f"{action.type}Result", stamped=True)


# --- judgement -----------------------------------------------------------------------------------


def judge(config: BridgeConfig, findings: Findings) -> Iterator[Check]:
    """Answers, the most basic first."""
    if findings.master_error is not None:
        yield Check(
            "master",
            FAIL,
            findings.master_error,
            f"Is the robot on, and in this network? Its ROS_MASTER_URI should be {config.master_uri}.",
        )
        return
    yield Check("master", OK, f"The ROS master at {config.master_uri} answers.")
    yield _names_here(findings.hosts)
    if findings.callback is not None:
        yield _names_there(findings.callback)
    yield _clock(findings.topics)
    for listened, topic in zip(_listened(config), findings.topics, strict=True):
        yield _topic(listened, topic)
    if findings.drive is not None:
        yield from _drive(config, findings.drive)


def _names_here(hosts: list[HostFound]) -> Check:
    name = "names, robot to console"
    unknown = [host.name for host in hosts if host.address is None]
    if unknown:
        return Check(
            name,
            FAIL,
            f"The robot's nodes call themselves {_and(unknown)}, which cannot be resolved here.",
            f'Add it to the robot\'s host aliases, such as {{"{unknown[0]}": "10.68.0.1"}}.',
        )
    unreached = [f"{host.name} ({host.address}: {host.error})" for host in hosts if host.error]
    if unreached:
        return Check(
            name,
            FAIL,
            f"Nodes on {_and(unreached)} cannot be reached.",
            "Is the address right (host aliases), a firewall between, or the node dead (rosnode cleanup)?",
        )
    return Check(name, OK, f"The robot's nodes ({_and([host.name for host in hosts])}) can be reached.")


def _names_there(callback: CallbackFound) -> Check:
    name = "names, console to robot"
    if callback.called:
        return Check(name, OK, f"The robot called the console back at {callback.advertised}.")
    text = f"The robot could not call the console back at {callback.advertised}"
    text += f" ({callback.error})." if callback.error else "."
    if callback.route and callback.advertised != callback.route:
        return Check(name, FAIL, text, f"Set the robot's advertised address to {callback.route}.")
    return Check(name, FAIL, text, "Does a firewall on this computer keep the robot out?")


def _clock(topics: list[TopicFound]) -> Check:
    skews = [topic.skew_s for topic in topics if topic.skew_s is not None]
    if not skews:
        return Check("clock", WARN, "No stamped message arrived, so clocks could not be compared.")
    skew_s = min(skews, key=abs)
    if abs(skew_s) <= SKEW_S:
        return Check("clock", OK, f"Robot and console agree within {max(abs(skew_s), 0.01):.2f} s.")
    way = "ahead of" if skew_s > 0 else "behind"
    return Check(
        "clock",
        WARN,
        f"The robot's stamps are {abs(skew_s):.1f} s {way} the console's clock.",
        "Let both follow the same time server (chrony). The console does not depend on it; recordings may.",
    )


def _topic(listened: Listened, found: TopicFound) -> Check:
    bad = FAIL if listened.what.split()[0] in NEEDED else WARN
    where = f"{listened.topic} ({listened.type})"
    if not found.publishers:
        return Check(listened.what, bad, f"Nobody publishes {where}.", _MISSING)
    if found.error is not None:
        return Check(listened.what, bad, f"{listened.topic} cannot be read: {found.error}.", _UNREADABLE)
    if found.type != listened.type:
        return Check(
            listened.what, bad, f"{listened.topic} is a {found.type}, not a {listened.type}.", _MISSING
        )
    if found.our_md5 is None:
        return Check(listened.what, bad, f"The console does not know the type {listened.type}.", _UNKNOWN)
    if found.md5 != found.our_md5:
        text = f"{where} has md5 {found.md5} on the robot and {found.our_md5} here: they cannot talk."
        return Check(listened.what, bad, text, "The robot has another version of the message's package.")
    if not found.messages and listened.what not in QUIET:
        return Check(listened.what, bad, f"{where} is there, but no message came.", _SILENT)
    unseen = sorted(set(listened.frames) - set(found.frames))
    if unseen:
        text = f"{listened.topic} says nothing from {_and(unseen)}, only from {_and(found.frames)}."
        return Check(listened.what, bad, text, "Correct the sensors' frame ids in the profile.")
    return Check(listened.what, OK, f"{where}: right type" + (", alive." if found.messages else "."))


_MISSING = "Is the node running, and is the topic's name in the robot's profile right (rostopic list)?"
_UNREADABLE = "See the answers on names above."
_UNKNOWN = "Choose one of the types that the profile's help text names."
_SILENT = "Is the sensor switched on and its driver well (rostopic hz)?"


def _drive(config: BridgeConfig, found: DriveFound) -> Iterator[Check]:
    drive = config.topics.drive
    if found.type not in (None, "*", drive.type):
        yield Check(
            "drive",
            FAIL,
            f"{drive.name} is a {found.type}, not a {drive.type}.",
            "Correct the profile's type.",
        )
    elif not found.subscribers:
        yield Check(
            "drive",
            FAIL,
            f"Nobody listens to {drive.name}: the robot would not move.",
            "Is the base controller (on TIAGo: twist_mux) running, and the drive topic right?",
        )
    else:
        yield Check("drive", OK, f"{_and(found.subscribers)} listens to {drive.name} ({drive.type}).")
    foreign = [node for node in found.publishers if node != BRIDGE_NODE]
    if foreign:
        yield Check(
            "other drivers",
            WARN,
            f"{_and(foreign)} publishes to {drive.name} too, past the console's gate.",
            "Stop it, or choose a drive topic of the console's own.",
        )
    else:
        yield Check("other drivers", OK, f"Nobody else publishes to {drive.name}.")


def _and(names: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1] if names else ""])) or "nothing"
