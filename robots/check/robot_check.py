"""Checks whether a robot can be driven from this computer. Each check has a result and a remedy.

The probe (`network.probe` of the robot's side) collects facts in a separate process, in the environment of the robot's
bridge; `judge` makes results from the facts. The web process never imports ROS.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec
from django.conf import settings
from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop
from msgspec import Struct, structs

from fleet.base.formats.sentences import in_words, localised, words_of
from robots.description.drawable import drawable
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot
from robots.registry.selectors import bridge_config, socket_path
from robots.shared.configuration.bridge_config import CLOCK_SKEW_S, BridgeConfig, Topics
from robots.shared.configuration.gate_profile import CLOSE_ECHO_M
from robots.shared.configuration.robot_ros import Ros, Ros1, Ros2, side_command
from robots.shared.messages.type_names import bare, in_ros2
from robots.shared.processes.probe_findings import (
    BRIDGE,
    CallbackFound,
    DescriptionFound,
    DriveFound,
    Findings,
    HostFound,
    Listened,
    Plan,
    TopicFound,
    watchdog_name,
)
from robots.shared.sentences import reason_of
from robots.shared.urdf.document import BadDescription
from robots.supervisor.ros_environment import WrapperMissing, ros_environment
from robots.supervisor.unready import Unready

Level = Literal["ok", "warn", "fail"]
OK: Level = "ok"
WARN: Level = "warn"
FAIL: Level = "fail"
PROBE_TIMEOUT_S = 20.0
NEEDED = ("odometry", "scan")  # required for motion
STAMPED = ("sensor_msgs/BatteryState", "diagnostic_msgs/DiagnosticArray")
QUIET = ("battery", "charging", "speech", "motions", "gripper", "torso")  # may be silent for a long time
GOALS = "/_action/status"  # of an action of ROS 2: silent until the first goal
MOST_LEFT_OUT = 3  # parts of a description that a result names
_findings = msgspec.json.Decoder(Findings)


class Check(Struct, frozen=True):
    """One result. `advice` is the remedy; "" if none is needed."""

    name: str
    level: Level
    text: str
    advice: str = ""


def run_checks(robot: Robot) -> list[Check]:
    """Run all checks and return their results; this takes a few seconds."""
    try:
        config = bridge_config(robot)
        environment = ros_environment(config, settings.FLEET_RUN_DIR)
    except Problems as problems:
        return [
            Check(
                _("registry"),
                FAIL,
                in_words(reason_of(problems)),
                _("Correct the robot’s entry or its profile."),
            )
        ]
    except WrapperMissing as error:
        return [
            Check(
                _("host aliases"),
                FAIL,
                in_words(reason_of(error)),
                _("Install it on the console’s computer."),
            )
        ]
    except Unready as error:
        advice = _("Do this on the computer of the robot’s bridge.")
        return [Check(_("software"), FAIL, in_words(reason_of(error)), advice)]
    except OSError as error:
        text = _("The console cannot save them (%s).") % error.strerror
        return [Check(_("host aliases"), FAIL, text, _("Is the disk of the console’s computer full?"))]
    try:
        findings = _probe(config, environment)
        if elsewhere := list(_elsewhere(robot)):
            # The robot calls the bridge's computer back, not this one.
            findings = msgspec.structs.replace(findings, callback=None)
        return [*elsewhere, *judge(config, findings)]
    except subprocess.TimeoutExpired:
        text = _("No answer within %d s.") % PROBE_TIMEOUT_S
        return [Check(_("probe"), FAIL, text, _("Is the network overloaded?"))]
    except (subprocess.CalledProcessError, msgspec.DecodeError) as error:
        return [Check(_("probe"), FAIL, _("The probe failed: %s") % error, _("See the console’s log."))]


def _elsewhere(robot: Robot) -> Iterator[Check]:
    if robot.bridge_address and not Path(socket_path(robot.id)).exists():
        yield Check(
            _("other computer"),
            WARN,
            _("This computer ran the check, but the robot’s bridge runs at %s.") % robot.bridge_address,
            _("Run sudo script/manage check_robot %s on that computer.") % robot.slug,
        )


def _probe(config: BridgeConfig, environment: dict[str, str]) -> Findings:
    done = subprocess.run(  # noqa: S603  (the console's own module)
        side_command(config.ros, "network.probe"),
        input=msgspec.json.encode(plan_for(config)),
        stdout=subprocess.PIPE,
        env=environment,
        cwd=settings.BASE_DIR,
        timeout=PROBE_TIMEOUT_S,
        check=True,
    )
    return _findings.decode(done.stdout)


def plan_for(config: BridgeConfig) -> Plan:
    """Return the topics that the robot's profile and entry name."""
    topics = config.topics
    return Plan(config.ros, topics.drive, _listened(config), arm=topics.arm)


def _listened(config: BridgeConfig) -> list[Listened]:
    """Return the topics to subscribe to."""
    found = [*_sensors(config.topics)]
    if isinstance(config.ros, Ros2):
        found = [structs.replace(one, type=in_ros2(one.type)) for one in found]
        return [*found, *_actions_2(config.topics)]
    return [*found, *_actions(config.topics)]


def _sensors(topics: Topics) -> Iterator[Listened]:
    yield Listened("odometry", topics.odometry.name, topics.odometry.type, stamped=True)
    for scan in topics.scans:
        yield Listened(f"scan {scan.topic}", scan.topic, "sensor_msgs/LaserScan", stamped=True)
    for topic in sorted({sonar.topic for sonar in topics.sonars}):
        frames = [sonar.frame_id for sonar in topics.sonars if sonar.topic == topic]
        yield Listened(f"sonars {topic}", topic, "sensor_msgs/Range", stamped=True, frames=frames)
    if topics.depth:
        yield Listened("depth", topics.depth.topic, topics.depth.type, stamped=True)
    if topics.joint_states:
        yield Listened("joint states", topics.joint_states.name, topics.joint_states.type, stamped=True)
    for camera in topics.cameras:
        yield Listened(f"camera {camera.topic}", camera.topic, camera.type, stamped=True)
    for what in ("battery", "charging", "diagnostics"):
        if source := getattr(topics, what):
            yield Listened(what, source.name, source.type, stamped=bare(source.type) in STAMPED)
    if topics.map:
        yield Listened("map", topics.map.name, topics.map.type, stamped=False)


def _actions_2(topics: Topics) -> Iterator[Listened]:
    """Yield the topic of each action on which its server tells of goals."""
    kind = "action_msgs/msg/GoalStatusArray"
    for what, topic in (("speech", topics.speech), ("motions", topics.motions)):
        if topic and topic.is_action:
            yield Listened(what, topic.name + GOALS, kind, stamped=False)
    for limb, source in topics.limbs.items():
        yield Listened(limb, source.action + GOALS, kind, stamped=False)
    if topics.navigation:
        yield Listened("navigation", topics.navigation.action + GOALS, kind, stamped=False)


def _actions(topics: Topics) -> Iterator[Listened]:
    for what in ("speech", "motions"):
        action = getattr(topics, what)
        if action and action.is_action:  # a plain topic for texts has no results
            yield Listened(what, f"{action.name}/result", f"{action.type}Result", stamped=True)
    for limb, source in topics.limbs.items():
        yield Listened(limb, f"{source.action}/result", f"{source.type}Result", stamped=True)
    if topics.navigation:
        status = f"{topics.navigation.action}/status"
        yield Listened("navigation", status, "actionlib_msgs/GoalStatusArray", stamped=True)


# --- results -------------------------------------------------------------------------------------


def judge(config: BridgeConfig, findings: Findings) -> Iterator[Check]:
    """Yield the results, the most basic first. If the robot's ROS does not answer, yield only that."""
    yield _answers(config.ros, findings)
    if findings.master_error is not None:
        return
    if isinstance(config.ros, Ros1):
        yield _names_here(findings.hosts)
    if findings.callback is not None:
        yield _names_there(findings.callback)
    yield _clock(findings)
    if isinstance(config.ros, Ros2):
        yield from _twins(findings.topics[0])
    for listened, topic in zip(_listened(config), findings.topics, strict=True):
        yield _topic(listened, topic)
    if findings.description is not None:
        if config.topics.arm:
            yield _arm(findings.description)
        yield _description(findings.description)
    if findings.drive is not None:
        yield from _drive(config, findings.drive)


def _answers(ros: Ros, findings: Findings) -> Check:
    """Return whether the robot's master, or its domain, answers."""
    if isinstance(ros, Ros1):
        name, text = _("master"), _("The ROS master at %s answers.") % ros.master_uri
        advice = _("Is the robot on, and in this network? Its ROS_MASTER_URI should be %s.") % ros.master_uri
    else:
        name, text = _("domain"), _("Nodes answer in domain %d.") % ros.domain_id
        advice = _(
            "Is the robot on, and in this network? Its ROS_DOMAIN_ID should be %d, and its nodes must not stay on its "
            "own computer (ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY). Many wireless networks pass on no "
            "multicast: write its addresses as static peers."
        )
        advice %= ros.domain_id
    if findings.master_error is None:
        return Check(name, OK, text)
    return Check(name, FAIL, words_of(findings, "master_error"), advice)


def _twins(odometry: TopicFound) -> Iterator[Check]:
    """Yield a fault if the odometry has several publishers: DDS lets two robots with the same names live."""
    if len(odometry.publishers) > 1:
        text = _("%s publish odometry: two robots seem to be in this domain.") % _and(odometry.publishers)
        yield Check(_("two robots"), FAIL, text, _("Give each robot a domain or a namespace of its own."))


def _names_here(hosts: list[HostFound]) -> Check:
    name = _("names, robot to console")
    unknown = [host.name for host in hosts if host.address is None]
    if unknown:
        return Check(
            name,
            FAIL,
            _("The robot’s nodes call themselves %s, which cannot be resolved here.") % _and(unknown),
            _("Add it to the robot’s host aliases, such as %s.") % f'{{"{unknown[0]}": "10.68.0.1"}}',
        )
    unreached = [f"{host.name} ({host.address}: {host.error})" for host in hosts if host.error]
    if unreached:
        return Check(
            name,
            FAIL,
            _("Nodes on %s cannot be reached.") % _and(unreached),
            _("Is the address right (host aliases), a firewall between, or the node dead (rosnode cleanup)?"),
        )
    return Check(name, OK, _("The robot’s nodes (%s) can be reached.") % _and([host.name for host in hosts]))


def _names_there(callback: CallbackFound) -> Check:
    name = _("names, console to robot")
    if callback.called:
        return Check(name, OK, _("The robot called the console back at %s.") % callback.advertised)
    error = words_of(callback, "error") if callback.error else ""
    where = f"{callback.advertised} ({error})" if error else callback.advertised
    text = _("The robot could not call the console back at %s.") % where
    if callback.route and callback.advertised != callback.route:
        return Check(name, FAIL, text, _("Set the robot’s advertised address to %s.") % callback.route)
    return Check(name, FAIL, text, _("Does a firewall on this computer keep the robot out?"))


def _clock(findings: Findings) -> Check:
    name = _("clock")
    if findings.clock_is_simulated:
        return Check(name, OK, _("The robot’s clock is simulated (/use_sim_time): ages are not compared."))
    skews = [topic.skew_s for topic in findings.topics if topic.skew_s is not None]
    if not skews:
        return Check(name, WARN, _("No stamped message arrived, so clocks could not be compared."))
    skew_s = min(skews, key=abs)
    if abs(skew_s) <= CLOCK_SKEW_S:
        agree = _("Robot and console agree within %s s.") % localised(max(abs(skew_s), 0.01), ".2f")
        return Check(name, OK, agree)
    ahead = _("The robot’s stamps are %s s ahead of the console’s clock.")
    behind = _("The robot’s stamps are %s s behind the console’s clock.")
    return Check(
        name,
        WARN,
        (ahead if skew_s > 0 else behind) % localised(abs(skew_s), ".1f"),
        _(
            "Let both follow the same time server (chrony). The console does not depend on it; recordings may."
        ),
    )


def _topic(listened: Listened, found: TopicFound) -> Check:
    name = _named(listened.what)
    bad = FAIL if listened.what.split()[0] in NEEDED else WARN
    words = {"topic": listened.topic, "type": listened.type}
    if not found.publishers:
        return Check(name, bad, _("No node publishes %(topic)s (%(type)s).") % words, _(_MISSING))
    if found.error is not None:
        text = _("%(topic)s cannot be read: %(error)s.") % {**words, "error": words_of(found, "error")}
        return Check(name, bad, text, _(_UNREADABLE))
    if found.type != listened.type:
        text = _("%(topic)s is a %(found)s, not a %(type)s.") % {**words, "found": found.type}
        return Check(name, bad, text, _(_MISSING))
    if found.our_md5 is None:
        return Check(name, bad, _("The console does not know the type %s.") % listened.type, _(_UNKNOWN))
    if found.md5 != found.our_md5:
        text = _("%(topic)s (%(type)s) has md5 %(theirs)s on the robot and %(ours)s here: they do not match.")
        sums = {"theirs": found.md5, "ours": found.our_md5}
        return Check(name, bad, text % {**words, **sums}, _(_OTHER_VERSION))
    speaks = listened.what not in QUIET and not listened.topic.endswith(GOALS)
    if not found.messages and speaks:
        text = _("%(topic)s (%(type)s) exists, but no message came.") % words
        return Check(name, bad, text, _(_SILENT))
    unseen = sorted(set(listened.frames) - set(found.frames))
    if unseen:
        frames = {"unseen": _and(unseen), "frames": _and(found.frames)}
        text = _("%(topic)s has no messages from %(unseen)s, only from %(frames)s.") % {**words, **frames}
        return Check(name, bad, text, _("Correct the sensors’ frame ids in the profile."))
    if close := sorted(frame for frame, range_m in found.ranges.items() if range_m <= CLOSE_ECHO_M):
        nearest = localised(min(found.ranges[frame] for frame in close), ".2f")
        metres = {"frames": _and(close), "metres": nearest}
        text = _("%(topic)s: %(frames)s reports %(metres)s m.") % {**words, **metres}
        return Check(name, WARN, text, _(_CLOSE))
    alive, quiet = _("%(topic)s (%(type)s): messages arrive."), _("%(topic)s (%(type)s): right type.")
    return Check(name, OK, (alive if found.messages else quiet) % words)


def _named(what: str) -> str:
    """Return `Listened.what` in the reader's language; the name of a topic in it is not translated."""
    kind, slash, topic = what.partition(" /")
    return _(kind) + slash + topic


# The kinds of `_listened`, for the catalogues of translators.
_KINDS = (
    *(gettext_noop("odometry"), gettext_noop("scan"), gettext_noop("sonars"), gettext_noop("depth")),
    *(gettext_noop("joint states"), gettext_noop("camera"), gettext_noop("battery")),
    *(gettext_noop("charging"), gettext_noop("speech"), gettext_noop("motions"), gettext_noop("map")),
    *(gettext_noop("gripper"), gettext_noop("torso"), gettext_noop("navigation")),
    gettext_noop("diagnostics"),
)
_MISSING = gettext_noop(
    "Is the node running, and is the topic’s name in the robot’s profile right (rostopic list, ros2 topic list)?"
)
_UNREADABLE = gettext_noop("See the results for names above.")
_UNKNOWN = gettext_noop("Choose one of the types in the profile’s help text.")
_OTHER_VERSION = gettext_noop("The robot has another version of the message’s package.")
_CLOSE = gettext_noop(
    "It holds reverse. If nothing stands there: clean the sensor, remove objects in front of it, "
    "or remove it from the profile."
)
_NOT_DRAWN = gettext_noop("The 3D view does not show these parts.")
_SILENT = gettext_noop("Is the sensor switched on, and does its driver work (rostopic hz, ros2 topic hz)?")


def _description(found: DescriptionFound) -> Check:
    name = _("description")
    try:
        if found.error is not None:
            raise BadDescription(found.sentence_of("error"))
        problems = drawable(found.text).problems
    except BadDescription as bad:
        return Check(
            name, WARN, _("/robot_description cannot be used: %s.") % in_words(reason_of(bad)), _(_NOT_DRAWN)
        )
    if not problems:
        return Check(name, OK, _("/robot_description can be used as a whole."))
    more = (
        [_("%d more (3D view: notes)") % (len(problems) - MOST_LEFT_OUT)]
        if len(problems) > MOST_LEFT_OUT
        else []
    )
    left_out = "; ".join([*map(in_words, problems[:MOST_LEFT_OUT]), *more])
    return Check(name, WARN, _("/robot_description is used, but: %s.") % left_out, _(_NOT_DRAWN))


def _arm(found: DescriptionFound) -> Check:
    name = _("description of the arm")
    lacking = [*found.links, *found.joints]
    if found.error is not None:
        text = _("/robot_description cannot be used: %s.") % words_of(found, "error")
        return Check(name, WARN, text, _("Without it the console does not know where the arm is."))
    if found.unplaced:
        text = _("/robot_description does not say where %s is.") % _and(found.unplaced)
        return Check(name, WARN, text, _("Without it the console does not know where the arm is."))
    if lacking:
        text = _("/robot_description lacks %s.") % _and(lacking)
        advice = _(
            "The console assumes a hand of 0.25 m there. Load the whole description, or correct the profile’s arm."
        )
        return Check(name, WARN, text, advice)
    return Check(name, OK, _("/robot_description has all links and joints of the arm."))


def _drive(config: BridgeConfig, found: DriveFound) -> Iterator[Check]:
    name, drive = _("drive"), config.topics.drive
    words = {"topic": drive.name, "type": drive.type}
    if found.type not in (None, "*", drive.type):
        text = _("%(topic)s is a %(found)s, not a %(type)s.") % {**words, "found": found.type}
        yield Check(name, FAIL, text, _("Correct the profile’s type."))
    elif found.refused:
        text = _("%(nodes)s gets nothing on %(topic)s: it asks for durability transient local.")
        advice = _("Let it ask for durability volatile: an old velocity must not move the robot.")
        yield Check(name, FAIL, text % {**words, "nodes": _and(found.refused)}, advice)
    elif not found.subscribers:
        yield Check(
            name,
            FAIL,
            _("No node listens to %(topic)s: the robot would not move.") % words,
            _("Is the base controller (on TIAGo: twist_mux) running, and the drive topic right?"),
        )
    else:
        text = _("%(nodes)s listens to %(topic)s (%(type)s).") % {**words, "nodes": _and(found.subscribers)}
        yield Check(name, OK, text)
    yield _others(
        drive.name,
        [node for node in found.publishers if node not in {BRIDGE, watchdog_name(config.robot_id)}],
    )


def _others(topic: str, nodes: list[str]) -> Check:
    name = _("other drivers")
    if not nodes:
        return Check(name, OK, _("No other node publishes to %s.") % topic)
    text = _("%(nodes)s also publishes to %(topic)s, without the console’s gate.")
    words = {"nodes": _and(nodes), "topic": topic}
    return Check(name, WARN, text % words, _("Stop it, or choose a drive topic that only the console uses."))


def _and(names: list[str]) -> str:
    if not names:
        return _("nothing")
    *first, last = names
    return _("%(first)s and %(last)s") % {"first": ", ".join(first), "last": last} if first else last
