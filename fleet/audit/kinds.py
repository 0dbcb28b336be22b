"""All kinds of records, each with its label, retention class and list."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import Enum

from django.db.models import TextChoices
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _
from msgspec import Struct

from robots.shared.wire import TASK_KINDS


class Kept(TextChoices):
    """Retention class of a record's expiring parts. The settings give each class its days."""

    SPEECH = "speech", _("speech of robots")
    DRIVING = "driving", _("drives, motions and what the robot refused")
    OTHER = "other", _("everything else")


class Listing(Enum):
    """The lists of the admin, apart from "Everything", which shows all kinds."""

    SPEECH = "speech"
    MOTION = "motion"
    REFUSALS = "refusals"
    OTHER = ""  # none


class Kind(Struct, frozen=True):
    """Common properties of all records of a kind."""

    label: str | Promise
    kept: Kept = Kept.OTHER
    listing: Listing = Listing.OTHER
    former: bool = False  # no longer recorded; old logs contain such records


def _speech(label: str | Promise) -> Kind:
    return Kind(label, Kept.SPEECH, Listing.SPEECH)


def _motion(label: str | Promise) -> Kind:
    return Kind(label, Kept.DRIVING, Listing.MOTION)


def _refusal(label: str | Promise) -> Kind:
    return Kind(label, Kept.DRIVING, Listing.REFUSALS)


# By the scope that a kind of task needs
_TASKS: dict[str, Callable[[str | Promise], Kind]] = {
    "speak": _speech,
    "drive": _motion,
    "motions": _motion,
    "topics": lambda label: Kind(label, Kept.DRIVING),
}

KINDS: dict[str, Kind] = {
    record: _TASKS[kind.scope](_(label)) for kind in TASK_KINDS for record, label in kind.records.items()
} | {
    "speech.cancel": _speech(_("speech cancelled")),
    "drive.start": _motion(_("drive began")),
    "drive.end": _motion(_("drive ended")),
    "go.hold": _motion(_("navigation held back after its goal")),
    "motion.cancel": _motion(_("motion cancelled")),
    "gate.begin": _refusal(_("gate held back")),
    "gate.end": _refusal(_("gate let go")),
    "refusal": _refusal(_("refused")),
    "control.take": Kind(_("control taken")),
    "control.take_over": Kind(_("control taken over")),
    "control.hand_over": Kind(_("control handed over")),
    "control.offer": Kind(_("control offered to the next in line")),
    "control.ask": Kind(_("control asked for")),
    "control.renew": Kind(_("control renewed")),
    "control.resume": Kind(_("control resumed")),
    "control.release": Kind(_("control given back"), former=True),
    "control.expire": Kind(_("control ran out"), former=True),
    "control.end": Kind(_("control ended")),
    "stop.press": Kind(_("stop pressed")),
    "stop.latch": Kind(_("robot stopped")),
    "stop.clear": Kind(_("stop cleared")),
    "stop.moves": Kind(_("robot moved although it was stopped")),
    "fault": Kind(_("fault")),
    "alert.begin": Kind(_("alert")),
    "alert.still": Kind(_("alert lasts")),
    "alert.over": Kind(_("alert over")),
    "alert.rule": Kind(_("rule of alerts changed")),
    "health.worse": Kind(_("part of the robot got worse")),
    "health.better": Kind(_("part of the robot got better")),
    "service.call": Kind(_("service called")),
    "parameter.set": Kind(_("parameter set")),
    "parameter.delete": Kind(_("parameter deleted")),
    "camera.start": Kind(_("began to watch a camera")),
    "camera.end": Kind(_("stopped watching a camera")),
    "booking.make": Kind(_("booked")),
    "booking.move": Kind(_("booking moved")),
    "booking.hand": Kind(_("booking handed to another person")),
    "booking.guest": Kind(_("guest of a booking by a hand-over of control")),
    "booking.tasks": Kind(_("tasks of a lesson chosen")),
    "turn.join": Kind(_("joined the line of a lesson")),
    "turn.leave": Kind(_("left the line of a lesson")),
    "turn.fill": Kind(_("everybody put into the line of a lesson")),
    "turn.spread": Kind(_("students spread over the robots of a lesson")),
    "turn.call": Kind(_("called for a turn")),
    "turn.wait": Kind(_("call taken back: nobody can drive the robot")),
    "turn.miss": Kind(_("called for a turn, did not come")),
    "turn.skip": Kind(_("turn skipped")),
    "turn.extend": Kind(_("turn extended")),
    "turn.hold": Kind(_("robot taken back from the line of a lesson")),
    "turn.go_on": Kind(_("robot given back to the line of a lesson")),
    "booking.hand_ask": Kind(_("colleague asked to take or share a booking")),
    "booking.join": Kind(_("colleague joined a shared booking")),
    "booking.hand_end": Kind(_("offer of a booking to a colleague ended")),
    "booking.approve": Kind(_("booking approved")),
    "booking.restore": Kind(_("booking given back")),
    "booking.cancel": Kind(_("booking cancelled")),
    "booking.undo": Kind(_("change undone that took bookings from people")),
    "booking.no_show": Kind(_("booking not used: the robot is free again")),
    "booking.wait": Kind(_("joined the waiting list of a slot")),
    "booking.wait_end": Kind(_("left the waiting list of a slot")),
    "booking.offer": Kind(_("slot offered from the waiting list")),
    "booking.accept": Kind(_("offered slot accepted")),
    "booking.offer_over": Kind(_("offer of a slot over")),
    "booking.feed": Kind(_("private calendar address made")),
    "booking.feed_end": Kind(_("private calendar address ended")),
    "push.add": Kind(_("device gets notifications")),
    "push.remove": Kind(_("device gets no more notifications")),
    "policy.change": Kind(_("booking policy changed")),
    "policy.remove": Kind(_("booking policy removed")),
    "holiday.add": Kind(_("holiday of the lab added")),
    "holiday.remove": Kind(_("holiday of the lab removed")),
    "robot.out_of_service": Kind(_("out of service")),
    "robot.back_in_service": Kind(_("back in service")),
    "host.code": Kind(_("code for a bridge host made")),
    "host.join": Kind(_("bridge host joined")),
    "host.remove": Kind(_("bridge host removed")),
    "robot.create": Kind(_("robot added")),
    "robot.change": Kind(_("robot changed")),
    "robot.delete": Kind(_("robot deleted")),
    "profile.create": Kind(_("profile added")),
    "profile.change": Kind(_("profile changed")),
    "profile.delete": Kind(_("profile deleted")),
    "phrase.create": Kind(_("phrase added")),
    "phrase.change": Kind(_("phrase changed")),
    "phrase.delete": Kind(_("phrase deleted")),
    "phrase.import": Kind(_("phrases imported")),
    "place.create": Kind(_("place of a map added")),
    "place.change": Kind(_("place of a map changed")),
    "place.delete": Kind(_("place of a map deleted")),
    "place.import": Kind(_("places of a map imported")),
    "map.name": Kind(_("map named")),
    "layout.share": Kind(_("layout of a page shared")),
    "layout.delete": Kind(_("shared layout of a page deleted")),
    "recording.begin": Kind(_("recording begun")),
    "recording.end": Kind(_("recording ended")),
    "recording.mark": Kind(_("last seconds kept")),
    "recording.keep": Kind(_("recording kept")),
    "recording.let_go": Kind(_("recording no longer kept")),
    "recording.share": Kind(_("recording shared")),
    "recording.unshare": Kind(_("recording no longer shared")),
    "recording.download": Kind(_("recording downloaded")),
    "recording.delete": Kind(_("recording deleted")),
    "recording.expire": Kind(_("recordings expired")),
    "allowance.create": Kind(_("allow-list entry added")),
    "allowance.change": Kind(_("allow-list entry changed")),
    "allowance.delete": Kind(_("allow-list entry deleted")),
    "role.change": Kind(_("role changed")),
    "group.create": Kind(_("robot group made")),
    "group.change": Kind(_("robot group changed")),
    "group.delete": Kind(_("robot group deleted")),
    "course.create": Kind(_("course made")),
    "course.change": Kind(_("course changed")),
    "course.archive": Kind(_("course archived")),
    "course.reopen": Kind(_("course opened again")),
    "course.enrol": Kind(_("enrolled in a course")),
    "course.marks": Kind(_("marks of a course exported")),
    "course.number": Kind(_("student numbers stored")),
    "course.unenrol": Kind(_("taken out of a course")),
    "course.invite": Kind(_("invitation to a course made")),
    "course.uninvite": Kind(_("invitation to a course revoked")),
    "qualification.create": Kind(_("qualification made")),
    "qualification.change": Kind(_("qualification changed")),
    "qualification.delete": Kind(_("qualification deleted")),
    "entry.restore": Kind(_("right or rule made as it was before a change")),
    "rule.make": Kind(_("rule of single sign-on made")),
    "rule.remove": Kind(_("rule of single sign-on removed")),
    "qualification.grant": Kind(_("qualification granted")),
    "qualification.revoke": Kind(_("qualification revoked")),
    "account.create": Kind(_("account made")),
    "account.change": Kind(_("account changed")),
    "account.delete": Kind(_("account deleted")),
    "token.make": Kind(_("token made")),
    "token.end": Kind(_("token ended")),
    "account.second_factor": Kind(_("second factor added or removed")),
    "account.single_sign_on": Kind(_("single sign-on connected with an account, or disconnected")),
    "account.email_refused": Kind(_("e-mail refused by the mail server")),
    "account.email_test": Kind(_("test e-mail sent")),
    "account.link": Kind(_("links to set a password shown")),
    "account.sign_in": Kind(_("signed in")),
    "account.sign_in_failed": Kind(_("sign-in failed")),
    "account.sign_out": Kind(_("signed out")),
    "audit.export": Kind(_("log exported")),
    "webhook.create": Kind(_("webhook made")),
    "webhook.pause": Kind(_("webhook paused")),
    "webhook.resume": Kind(_("webhook resumed")),
    "webhook.delete": Kind(_("webhook deleted")),
    "setup.admin": Kind(_("console set up with its one-time code")),
    "backup.make": Kind(_("backup made")),
    "backup.check": Kind(_("backup checked")),
    "backup.restore": Kind(_("backup restored")),
    "audit.verify": Kind(_("log verified")),
    "audit.expire": Kind(_("details expired")),
    "audit.checkpoint": Kind(_("checkpoint: what is older may be removed")),
    "audit.clock": Kind(_("clock of the console judged")),
    "audit.erase": Kind(_("person erased")),
}


_MOVING = [kind.record.split(".")[0] for kind in TASK_KINDS if kind.scope in ("drive", "motions")]
# Groups of kinds in the filter, by the first part of a kind's name.
_GROUPS: tuple[tuple[str | Promise, tuple[str, ...]], ...] = (
    (_("Speech"), ("speech",)),
    (_("Driving and motions"), ("drive", *_MOVING)),
    (_("Gate and refusals"), ("gate", "refusal")),
    (_("Control"), ("control",)),
    (_("Stop"), ("stop",)),
    (_("Recordings"), ("recording",)),
    (_("Health and faults"), ("health", "fault", "alert")),
    (_("Topics, services and cameras"), ("publish", "topic", "service", "parameter", "camera")),
    (_("Bookings"), ("booking", "turn", "policy", "holiday")),
    (
        _("Robots, phrases and places"),
        ("robot", "host", "profile", "phrase", "place", "map", "layout", "allowance"),
    ),
    (_("Rights and courses"), ("role", "group", "course", "qualification", "rule", "entry")),
    (_("Accounts"), ("account", "token", "push", "setup")),
    (_("Log, backups and webhooks"), ("audit", "backup", "webhook")),
)


def grouped(kinds: Iterable[str]) -> list[tuple[str | Promise, list[str]]]:
    """Return the kinds in groups, each group with its name. A group without kinds is left out."""
    kinds = list(kinds)
    groups = [
        (name, [kind for kind in kinds if kind.split(".")[0] in subjects]) for name, subjects in _GROUPS
    ]
    return [(name, found) for name, found in groups if found]


def kinds_listed(listing: Listing) -> list[str]:
    """Return the kinds that a list shows."""
    return [name for name, kind in KINDS.items() if kind.listing == listing]
