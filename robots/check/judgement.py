"""Results of a check, from the facts that the probe found."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

from django.utils.translation import gettext as _
from django.utils.translation import gettext_noop
from msgspec import structs

from fleet.base.formats.sentences import in_words, localised, words_of
from robots.check.domain import domain_checks, namespace_check
from robots.check.plan import GOALS, listened_of, plan_for
from robots.check.results import FAIL, OK, WARN, Check, Level, listed
from robots.description.drawable import drawable
from robots.shared.configuration.bridge_config import CLOCK_SKEW_S, BridgeConfig, Topic
from robots.shared.configuration.gate_profile import CLOSE_ECHO_M
from robots.shared.configuration.robot_ros import Ros, Ros1, Ros2
from robots.shared.processes.probe_findings import (
    BRIDGE,
    FEEDBACK,
    TYPE,
    CallbackFound,
    DescriptionFound,
    DriveFound,
    Findings,
    HostFound,
    Listened,
    TopicFound,
    watchdog_name,
)
from robots.shared.sentences import reason_of
from robots.shared.urdf.document import BadDescription

NEEDED = ("odometry", "scan")  # required for motion
QUIET = ("battery", "charging", "speech", "motions", "gripper", "torso")  # may be silent for a long time
TYPE_HASH = "RIHS"  # begins a hash of ROS 2, in place of an md5 sum
MOST_LEFT_OUT = 3  # parts of a description that a result names


def judge(config: BridgeConfig, findings: Findings) -> Iterator[Check]:
    """Yield the results, the most basic first. If the robot's ROS does not answer, yield only that and its reason."""
    yield _answers(config.ros, findings)
    if findings.master_error is not None:
        return
    if isinstance(config.ros, Ros1):
        yield _names_here(findings.hosts)
    if findings.namespaces:
        yield namespace_check(listened_of(config)[0].topic, findings.namespaces)
        return
    if findings.callback is not None:
        yield _names_there(findings.callback)
    yield _clock(findings)
    if isinstance(config.ros, Ros2):
        yield from domain_checks(findings)
    heard = zip(listened_of(config), findings.topics, strict=True)
    for _what, entries in groupby(heard, lambda entry: entry[0].what):
        yield _entry(list(entries))
    if findings.description is not None:
        if config.topics.arm:
            yield _arm(findings.description)
        yield _description(findings.description)
    if findings.drive is not None:
        yield from _drive(config, findings.drive)
    for what, wanted in plan_for(config).commands.items():
        if fault := _unheard(_named(what), wanted, findings.commands.get(what)):
            yield fault


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


def _names_here(hosts: list[HostFound]) -> Check:
    name = _("names, robot to console")
    unknown = [host.name for host in hosts if host.address is None]
    if unknown:
        return Check(
            name,
            FAIL,
            _("The robot’s nodes call themselves %s, which cannot be resolved here.") % listed(unknown),
            _("Add it to the robot’s host aliases, such as %s.") % f'{{"{unknown[0]}": "10.68.0.1"}}',
        )
    unreached = [f"{host.name} ({host.address}: {host.error})" for host in hosts if host.error]
    if unreached:
        return Check(
            name,
            FAIL,
            _("Nodes on %s cannot be reached.") % listed(unreached),
            _("Is the address right (host aliases), a firewall between, or the node dead (rosnode cleanup)?"),
        )
    return Check(
        name, OK, _("The robot’s nodes (%s) can be reached.") % listed([host.name for host in hosts])
    )


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
        return Check(name, OK, _("The robot’s clock is simulated (use_sim_time): ages are not compared."))
    skews = [topic.skew_s for topic in findings.topics if topic.skew_s is not None]
    if not skews:
        return Check(name, WARN, _("No stamped message arrived, so clocks could not be compared."))
    skew_s = min(skews, key=abs)
    if abs(skew_s) <= CLOCK_SKEW_S:
        agree = _("Robot and console agree within %s s.") % localised(max(abs(skew_s), 0.01), ".2f")
        return Check(name, OK, agree)
    ahead = _("The robot’s stamps are %s s ahead of the console’s clock.")
    behind = _("The robot’s stamps are %s s behind the console’s clock.")
    text = (ahead if skew_s > 0 else behind) % localised(abs(skew_s), ".1f")
    advice = _(
        "Let both follow the same time server (chrony). The console does not depend on it; recordings may."
    )
    return Check(name, WARN, text, advice)


def _entry(entries: list[tuple[Listened, TopicFound]]) -> Check:
    """Return the result for one entry of the profile: for its own name, else for the one that the robot has instead."""
    own, found = entries[0]
    there = [entry for entry in entries if entry[1].publishers]
    if found.publishers or not there:
        return _topic(own, found)
    others = listed([listened.topic.removesuffix(GOALS) for listened, _found in there])
    names = {"topic": own.topic.removesuffix(GOALS), "others": others}
    if len(there) > 1:
        text = _("The robot has no %(topic)s, but %(others)s.") % names
        return Check(_named(own.what), WARN, text, _("Enter one of them in the robot’s profile."))
    check, instead = _topic(*there[0]), _("It takes the place of %(topic)s.") % names
    return structs.replace(check, text=" ".join([check.text, instead]))


def _topic(listened: Listened, found: TopicFound) -> Check:
    name = _named(listened.what)
    bad = FAIL if listened.what.split()[0] in NEEDED else WARN
    words = {"topic": listened.topic.removesuffix(GOALS), "type": listened.type.removesuffix(FEEDBACK)}
    if not found.publishers:
        return Check(name, bad, _("No node publishes %(topic)s (%(type)s).") % words, _(_MISSING))
    if found.error is not None:
        text = _("%(topic)s cannot be read: %(error)s.") % {**words, "error": words_of(found, "error")}
        return Check(name, bad, text, _(_UNREADABLE))
    if found.type != listened.type:
        theirs = (found.type or "").removesuffix(FEEDBACK)
        text = _("%(topic)s is a %(found)s, not a %(type)s.") % {**words, "found": theirs}
        return Check(name, bad, text, _(_MISSING))
    if found.our_md5 is None:
        return Check(name, bad, _("The console does not know the type %s.") % words["type"], _(_UNKNOWN))
    if found.misfits:
        return _kept_nothing(name, bad, listened, found)
    if found.md5 != found.our_md5 and found.our_md5.startswith(TYPE_HASH):
        text = _("%(topic)s (%(type)s) has other fields on the robot than in the package installed here.")
        return Check(name, bad, text % words, _(_OTHER_PACKAGE))
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
        frames = {"unseen": listed(unseen), "frames": listed(found.frames)}
        text = _("%(topic)s has no messages from %(unseen)s, only from %(frames)s.") % {**words, **frames}
        return Check(name, bad, text, _("Correct the sensors’ frame ids in the profile."))
    if close := sorted(frame for frame, range_m in found.ranges.items() if range_m <= CLOSE_ECHO_M):
        nearest = localised(min(found.ranges[frame] for frame in close), ".2f")
        metres = {"frames": listed(close), "metres": nearest}
        text = _("%(topic)s: %(frames)s reports %(metres)s m.") % {**words, **metres}
        return Check(name, WARN, text, _(_CLOSE))
    alive, quiet = _("%(topic)s (%(type)s): messages arrive."), _("%(topic)s (%(type)s): right type.")
    return Check(name, OK, (alive if found.messages else quiet) % words)


def _kept_nothing(name: str, bad: Level, listened: Listened, found: TopicFound) -> Check:
    """Return that a publisher keeps nothing for listeners that come later, or may lose it on the way."""
    first = found.misfits[0]
    words = {
        "nodes": listed(sorted({one.node for one in found.misfits if one.policy == first.policy})),
        "topic": listened.topic,
        "policy": first.policy,
        "offered": first.offered,
        "asked": first.asked,
    }
    text = _(
        "%(nodes)s publishes %(topic)s with %(policy)s %(offered)s: the console, which comes later, gets nothing."
    )
    advice = _("Set the %(policy)s of its publisher to %(asked)s.")
    return Check(name, bad, text % words, advice % words)


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
    *(gettext_noop("diagnostics"), gettext_noop("fixed frames"), gettext_noop("head"), gettext_noop("pose")),
)
_MISSING = gettext_noop(
    "Is the node running, and is the topic’s name in the robot’s profile right (rostopic list, ros2 topic list)?"
)
_UNREADABLE = gettext_noop("See the results for names above.")
_UNKNOWN = gettext_noop("Choose one of the types in the profile’s help text.")
_OTHER_VERSION = gettext_noop("The robot has another version of the message’s package.")
_OTHER_PACKAGE = gettext_noop(
    "The robot has another version of the message’s package: install it here, and name its set-up script."
)
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
        text = _("/robot_description does not say where %s is.") % listed(found.unplaced)
        return Check(name, WARN, text, _("Without it the console does not know where the arm is."))
    if lacking:
        text = _("/robot_description lacks %s.") % listed(lacking)
        advice = _(
            "The console assumes a hand of 0.25 m there. Load the whole description, or correct the profile’s arm."
        )
        return Check(name, WARN, text, advice)
    return Check(name, OK, _("/robot_description has all links and joints of the arm."))


def _drive(config: BridgeConfig, found: DriveFound) -> Iterator[Check]:
    name, entered = _("drive"), config.topics.drive
    drive = structs.replace(entered, type=found.takes or entered.type)
    words = {"topic": drive.name, "type": drive.type}
    if fault := _unheard(name, drive, found):
        understood = found.subscribers and found.type in (None, "*", drive.type)
        yield fault if understood else structs.replace(fault, level=FAIL)
    elif not found.subscribers:
        yield Check(
            name,
            FAIL,
            _("No node listens to %(topic)s: the robot would not move.") % words,
            _("Is the base controller (on TIAGo: twist_mux) running, and the drive topic right?"),
        )
    else:
        text = _("%(nodes)s listens to %(topic)s (%(type)s).") % {**words, "nodes": listed(found.subscribers)}
        if drive.type != entered.type:
            followed = _("The profile has %s: the console follows the robot.") % entered.type
            text = " ".join([text, followed])
        yield Check(name, OK, text)
    own = {BRIDGE, watchdog_name(config.robot_id)}
    bridges = found.publishers.count(BRIDGE)
    yield _others(drive.name, [node for node in found.publishers if node not in own], bridges)


def _unheard(name: str, topic: Topic, found: DriveFound | None) -> Check | None:
    """Return why nodes do not get, or do not understand, what the console publishes on a topic."""
    if found is None:
        return None
    words = {"topic": topic.name, "type": topic.type, "found": found.type}
    if found.type not in (None, "*", topic.type):
        text = _("%(topic)s is a %(found)s, not a %(type)s.")
        return Check(name, WARN, text % words, _("Correct the profile’s type."))
    if found.refused:
        first = found.refused[0]
        words |= {"nodes": listed(sorted({one.node for one in found.refused if one.policy == first.policy}))}
        words |= {"policy": first.policy, "offered": first.offered, "asked": first.asked}
        text = _(
            "%(nodes)s gets nothing on %(topic)s: it asks for %(policy)s %(asked)s, the console offers %(offered)s."
        )
        if first.policy == TYPE:
            return Check(name, WARN, text % words, _("Correct the profile’s type, or its own."))
        advice = _(
            "Set the %(policy)s of its subscription to %(offered)s: the console keeps no old commands, and promises "
            "no times."
        )
        return Check(name, WARN, text % words, advice % words)
    if found.differing:
        text = _(
            "%(nodes)s listens to %(topic)s, but its %(type)s has other fields than the one installed here."
        )
        return Check(name, WARN, text % {**words, "nodes": listed(found.differing)}, _(_OTHER_PACKAGE))
    return None


def _others(topic: str, nodes: list[str], bridges: int) -> Check:
    name = _("other drivers")
    if bridges > 1:
        text = _("The bridges of two consoles publish to %s.") % topic
        return Check(name, WARN, text, _("Stop one of them."))
    if not nodes:
        return Check(name, OK, _("No other node publishes to %s.") % topic)
    text = _("%(nodes)s also publishes to %(topic)s, without the console’s gate.")
    words = {"nodes": listed(nodes), "topic": topic}
    return Check(name, WARN, text % words, _("Stop it, or choose a drive topic that only the console uses."))
