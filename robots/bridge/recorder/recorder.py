"""Decides what is kept: the black box while somebody has control, and recordings on request. Without ROS.

Messages arrive on many threads, lines of the bridge on one; a lock joins them, and nobody waits for a disk within it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, NamedTuple
from uuid import UUID, uuid4

import msgspec
from msgspec import Struct, structs

from robots.bridge.recorder.black_box.contacts import Contacts, reports_contact
from robots.bridge.recorder.black_box.ring import KEPT_S, Latched, Message, Origin, Ring, picture_gap_s
from robots.bridge.recorder.clock import RecordingClock
from robots.bridge.recorder.erasing.nameless import Nameless
from robots.bridge.recorder.files import finished_files
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.recorder.recorder_messages import (
    Begin,
    Begun,
    Continued,
    End,
    Finished,
    Happened,
    InControl,
    Kept,
    Lost,
    Over,
    Progress,
    RecorderRequest,
    Removed,
    Said,
    Stored,
    goes_on,
    origin_of,
)
from robots.bridge.recorder.take import Take
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig, RecordingPlace
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.records.record_sink import TakenRecording
from robots.shared.sentences import say
from robots.shared.wire import BlackBoxState, RecordingState, Refusal

log = logging.getLogger(__name__)

BEFORE_S, AFTER_S = 30.0, 15.0  # of an event
LONGEST_BOX_S = 180.0  # further events within it belong to the same file
LINGER_S = 30.0  # the box goes on after control has ended: an event may follow
MOST_SHOWN = 10  # topics in the state
TOLD_S = 60.0  # that a recording ended by a fault

_request = msgspec.json.Decoder(RecorderRequest)


class Wanted(NamedTuple):
    """The topics to read: each with the least time between two messages (s); and further ones."""

    topics: Mapping[str, float]
    others: Literal["", "all", "pictures_not", "contacts"] = ""


class _Order(NamedTuple):
    """A recording on request."""

    order: wire.LinkRecord
    takes: tuple[Take, ...]  # its files; the last one is being written
    latched: Latched  # what the next file begins with
    began_s: float
    ends_s: float

    @property
    def take(self) -> Take:
        return self.takes[-1]

    @property
    def bytes(self) -> int:
        return sum(take.bytes for take in self.takes)


class _Box(NamedTuple):
    """An event that is being kept."""

    take: Take
    began_s: float
    ends_s: float


class Recorder:
    """The recorder of one robot. `say` sends a report to the bridge; `follow` gets what must be read."""

    def __init__(
        self,
        config: BridgeConfig,
        place: RecordingPlace,
        say: Callable[[Struct], None],
        follow: Callable[[Wanted], None],
    ) -> None:
        self.directory = RecordingDirectory(Path(place.directory), place.quota_bytes, place.least_free_bytes)
        self._robot = config.robot_id
        self._version = place.version
        self._profile = config.ros.profile
        self._box_topics = box_topics(config)
        self._say = say
        self._follow = follow
        self._lock = threading.RLock()
        self._control = InControl()
        self._controls: list[tuple[int, str]] = []  # its changes in the last minute: when, and the session
        self._box_until_s = 0.0  # without control
        self._ring: Ring | None = None
        self._contacts = Contacts()
        self._box: _Box | None = None
        self._box_state = BlackBoxState()
        self._order: _Order | None = None
        self._ended: tuple[RecordingState, float] | None = None  # the last recording, if it ended by a fault
        self._takes: set[Take] = set()  # that are not finished
        self._happened: list[tuple[int, Take]] = []  # events whose file is not open yet
        self._numbers: dict[str, int] = {}  # of the bridge's messages
        self._nameless = Nameless()
        self._rate = (0.0, 0, 0.0)  # time and bytes of the last measurement, and the rate

    # --- messages -------------------------------------------------------------------------------------

    def arrived(self, message: Message) -> None:
        """Take a message, on any thread."""
        with self._lock:
            if self._ring is not None and self._is_boxed(message.origin):
                kept = self._ring.put(message)
                if kept and self._box is not None:
                    self._box.take.put(message)
            if self._order is not None and _is_recorded(message.origin, self._order.order):
                self._order.take.put(message)
                if message.origin.latched:
                    self._order.latched.put(message)
            self._notice_contact(message)

    def missed(self, origin: Origin, count: int) -> None:
        """Count messages that were lost before they arrived."""
        with self._lock:
            if self._ring is not None and self._is_boxed(origin):
                self._ring.missed(origin, count, time.monotonic_ns())
                if self._box is not None:
                    self._box.take.missed(origin, count)
            if self._order is not None and _is_recorded(origin, self._order.order):
                self._order.take.missed(origin, count)

    def left_out(self, count: int) -> None:
        """Note that so many topics are not read: there are too many."""
        with self._lock:
            if self._order is not None:
                self._order.take.leave_out(count)

    def _is_boxed(self, origin: Origin) -> bool:
        return (
            origin.topic in self._box_topics
            or not origin.publisher
            or reports_contact(origin.topic, origin.type)
        )

    def _notice_contact(self, message: Message) -> None:
        topic = message.origin.topic
        if reports_contact(topic, message.origin.type) and self._contacts.begins(message):
            self._keep(Happened("contact", message.at_ns, say("{topic} reports a contact.", topic=topic)))

    # --- lines of the bridge ---------------------------------------------------------------------------

    def handle_line(self, line: bytes) -> None:
        """Carry out a request of the bridge. Raises msgspec.DecodeError."""
        match _request.decode(line):
            case Said() as said:
                number = self._numbers[said.topic] = self._numbers.get(said.topic, 0) + 1
                data = self._nameless(bytes(said.message))
                self.arrived(Message(origin_of(said.topic), number, said.at_ns, data))
            case Lost(topic=topic, count=count):
                self.missed(origin_of(topic), count)
            case InControl() as control:
                self._take_control(control)
            case Happened() as happened:
                self._keep(happened)
            case Begin(order=order, continues=continues):
                self._begin(order, continues)
            case End(recording=recording, why=why):
                self._end(recording, why)
            case Stored(recording=recording):
                try:
                    self.directory.stored(recording)
                except OSError as error:
                    log.warning("%s is reported again: %s", recording, error)

    def _take_control(self, control: InControl) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            self._control = control
            self._controls = [*self._controls_since(now_ns - int(KEPT_S * 1e9)), (now_ns, control.session)]
            for take in self._takes:
                take.control(now_ns, control.session)
            if control.person:
                self._ring = self._ring or Ring()
                self._box_state = structs.replace(self._box_state, kept=0, dropped=0, refusal=None)
            else:
                self._box_until_s = time.monotonic() + LINGER_S
            self._follow_wanted()

    def _controls_since(self, from_ns: int) -> list[tuple[int, str]]:
        """Return the changes of control since then, and the last one before."""
        before = [change for change in self._controls if change[0] < from_ns]
        return [*before[-1:], *(change for change in self._controls if change[0] >= from_ns)]

    def _keep(self, happened: Happened) -> None:
        """Keep what was before an event, and what follows. It is noted in a recording on request, too."""
        now_s = time.monotonic()
        with self._lock:
            if self._order is not None:
                self._order.take.mark(happened.event, happened.at_ns, happened.text, happened.by)
            if self._ring is None:
                return
            box = self._box
            if box is None or box.take.refusal is not None or now_s + AFTER_S > box.began_s + LONGEST_BOX_S:
                if box is not None:
                    box.take.end()
                box = _Box(self._open_box(happened, self._ring), now_s, now_s)
            else:
                box.take.mark(happened.event, happened.at_ns, happened.text, happened.by)
            self._box = box._replace(ends_s=now_s + AFTER_S)
            self._happened.append((happened.at_ns, box.take))
            self._box_state = structs.replace(
                self._box_state, keeps=happened.event, kept=self._box_state.kept + 1, refusal=None
            )
        if box.take.is_open:
            self._answer(box.take, None)

    def _open_box(self, happened: Happened, ring: Ring) -> Take:
        clock = RecordingClock()
        from_ns = happened.at_ns - int(BEFORE_S * 1e9)
        begins = clock.log_ns(from_ns) / 1e9
        about = TakenRecording(
            recording=uuid4(),
            robot=self._robot,
            kind="black_box",
            begins=begins,
            ends=begins,
            bytes=0,
            directory=str(self.directory.path),
            name="",
            topics=[],
            person=happened.person or self._control.person,
            session=self._control.session,
            version=self._version,
        )
        take = Take(
            self.directory,
            about,
            clock,
            self._box_done,
            self._removed,
            opened=lambda: self._answer(take, None),
            profile=self._profile,
        )
        take.mark(happened.event, happened.at_ns, happened.text, happened.by)
        for change in self._controls_since(from_ns):
            take.control(*change)
        for origin, count in ring.missing_since(from_ns).items():
            take.missed(origin, count)
        self._takes.add(take)
        take.start(ring.since(from_ns))
        return take

    def _answer(self, take: Take, refusal: Refusal | None) -> None:
        """Tell whether the events of a box are kept."""
        with self._lock:
            told = [at_ns for at_ns, whose in self._happened if whose is take]
            self._happened = [one for one in self._happened if one[1] is not take]
        for at_ns in told:
            self._say(Kept(at_ns, refusal))

    def _begin(self, order: wire.LinkRecord, continues: UUID | None) -> None:
        with self._lock:
            if self._order is not None:
                going = self._order.order
                self._say(Begun(order.recording, goes_on(going.by, going.recording)))
                return
            now_s = time.monotonic()
            self._ended = None
            self._rate = (now_s, 0, 0.0)
            latched = Latched()
            for message in self._latched_now(order):
                latched.put(message)
            take = self._open_order(order, continues, latched)
            self._order = _Order(order, (take,), latched, now_s, now_s + order.seconds)
            self._follow_wanted()

    def _open_order(self, order: wire.LinkRecord, continues: UUID | None, latched: Latched) -> Take:
        begins = time.time()
        about = TakenRecording(
            recording=order.recording,
            robot=self._robot,
            kind=order.kind,
            begins=begins,
            ends=begins,
            bytes=0,
            directory=str(self.directory.path),
            name="",
            topics=[],
            person=order.person,
            session=order.session,
            booking=order.booking,
            course=order.course,
            reason=order.reason,
            version=self._version,
            continues=continues,
        )
        take = Take(
            self.directory,
            about,
            RecordingClock(),
            self._order_done,
            self._removed,
            opened=lambda: self._say(Begun(order.recording)),
            profile=self._profile,
        )
        for change in self._controls[-1:]:
            take.control(*change)
        self._takes.add(take)
        take.start(latched)
        return take

    def _go_on(self, going: _Order) -> Take:
        """Begin the next file of a recording; return the full one, which is to be ended."""
        order = structs.replace(going.order, recording=uuid4())
        take = self._open_order(order, going.take.about.recording, going.latched)
        self._order = going._replace(order=order, takes=(*going.takes, take))
        return going.take

    def _end(self, recording: UUID, why: str) -> None:
        """End a recording: the next one may begin while its file is finished."""
        with self._lock:
            going = self._order
            if going is not None and any(take.about.recording == recording for take in going.takes):
                going.take.end(why)
                self._order = None
                self._follow_wanted()

    def _latched_now(self, order: wire.LinkRecord) -> list[Message]:
        """Return the latched messages that the ring has: their topics are read already, and send nothing again."""
        if self._ring is None:
            return []
        return [
            message
            for message in self._ring.since(time.monotonic_ns())
            if message.origin.latched and _is_recorded(message.origin, order)
        ]

    # --- the clock -------------------------------------------------------------------------------------

    def tick(self) -> None:
        """End what is over, and tell the bridge what goes on. Called each second."""
        now_s = time.monotonic()
        full: Take | None = None
        with self._lock:
            if self._order is not None and now_s >= self._order.ends_s:
                self._order.take.end(say("The time for it was over."))
            elif self._order is not None and self._order.take.is_full:
                full = self._go_on(self._order)
            if self._box is not None and now_s >= self._box.ends_s:
                self._box.take.end()
                self._box = None  # an event that follows has a file of its own
                self._box_state = structs.replace(self._box_state, keeps=None)
            box_ends = not self._control.person and now_s >= self._box_until_s and self._box is None
            if self._ring is not None and box_ends:
                self._ring = None
                self._box_state = BlackBoxState()
                self._follow_wanted()
            progress = Progress(self._recording_state(now_s), self._black_box_state())
            going = self._order
        if full is not None and going is not None:
            self._say(Continued(full.about.recording, going.take.about.recording))
            full.end()  # now: `Over` of it comes after that
        self._say(progress)

    def _recording_state(self, now_s: float) -> RecordingState | None:
        if self._order is None:
            if self._ended is not None and now_s - self._ended[1] < TOLD_S:
                return self._ended[0]
            return None
        order, take, size = self._order.order, self._order.take, self._order.bytes
        before_s, before, _ = self._rate
        if now_s - before_s >= 1.0 and size != before:
            self._rate = (now_s, size, (size - before) / (now_s - before_s))
        return RecordingState(
            recording=order.recording,
            kind=order.kind,
            by=order.by,
            topics=order.topics[:MOST_SHOWN] if isinstance(order.topics, list) else order.topics,
            topics_more=max(len(order.topics) - MOST_SHOWN, 0) if isinstance(order.topics, list) else 0,
            since_s=round(now_s - self._order.began_s, 1),
            left_s=round(max(self._order.ends_s - now_s, 0.0), 1),
            bytes=size,
            bytes_per_s=round(self._rate[2]),
            free_bytes=take.free_bytes,
            left_out=take.about.left_out,
            dropped=sum(one.dropped.total() for one in self._order.takes),
            refusal=take.trouble,
        )

    def _black_box_state(self) -> BlackBoxState | None:
        if self._ring is None:
            return None
        held_s = min(self._ring.held_s(time.monotonic_ns()), 60)
        return structs.replace(self._box_state, seconds=held_s)

    def _follow_wanted(self) -> None:
        """Tell what must be read now."""
        wanted: dict[str, float] = {}
        others: Literal["", "all", "pictures_not", "contacts"] = ""
        if self._ring is not None:
            wanted.update(self._box_topics)
            others = "contacts"
        if self._order is not None:
            topics = self._order.order.topics
            if isinstance(topics, list):
                wanted.update(dict.fromkeys(topics, 0.0))
            else:
                others = topics
                wanted = {topic: 0.0 if others == "all" else gap_s for topic, gap_s in wanted.items()}
        self._follow(Wanted(wanted, others))

    # --- on the threads of writers ----------------------------------------------------------------------

    def _box_done(self, take: Take, result: TakenRecording | Refusal) -> None:
        with self._lock:
            self._takes.discard(take)
            if self._box is not None and self._box.take is take:
                self._box = None
                self._box_state = structs.replace(self._box_state, keeps=None)
            refusal = (result if isinstance(result, Refusal) else take.refusal) or self._box_state.refusal
            dropped = self._box_state.dropped + take.dropped.total()
            self._box_state = structs.replace(self._box_state, refusal=refusal, dropped=dropped)
        self._answer(take, take.refusal)
        self._report(result)

    def _order_done(self, take: Take, result: TakenRecording | Refusal) -> None:
        over: Over | Begun = (
            Over(take.about.recording) if take.is_open else Begun(take.about.recording, take.refusal)
        )
        with self._lock:
            self._takes.discard(take)
            if self._order is not None and self._order.take is take:
                now_s = time.monotonic()
                had_begun = take.is_open or take.about.continues is not None
                if had_begun and take.refusal is not None and (state := self._recording_state(now_s)):
                    self._ended = structs.replace(state, left_s=0.0), now_s
                self._order = None
                self._follow_wanted()
        self._say(over)
        self._report(result)

    def _report(self, result: TakenRecording | Refusal) -> None:
        if isinstance(result, TakenRecording):
            self._say(Finished(result))

    def _removed(self, recording: UUID) -> None:
        log.warning("the black box %s was removed for newer recordings", recording)
        self._say(Removed(recording))

    # --- files of earlier processes ---------------------------------------------------------------------

    def recover(self) -> None:
        """Finish cut files, and report those without a row. Raises OSError."""
        for _ in finished_files.finish_cut(self.directory):
            pass
        for taken in finished_files.without_row(self.directory):
            if taken.robot == self._robot:
                self._say(Finished(taken))

    def lost_robot(self) -> None:
        """Keep what was before the loss of the robot."""
        text = say("The connection to the robot’s ROS was lost.")
        self._keep(Happened("fault", time.monotonic_ns(), text))
        self._end_takes(text)

    def close(self, within_s: float) -> None:
        """Finish what goes on: this process ends."""
        takes = self._end_takes(say("Its recorder ended."))
        until_s = time.monotonic() + within_s
        for take in takes:
            take.join(max(until_s - time.monotonic(), 0.0))

    def _end_takes(self, why: str) -> list[Take]:
        with self._lock:
            takes = list(self._takes)
        for take in takes:
            take.end(why)
        return takes


def _is_recorded(origin: Origin, order: wire.LinkRecord) -> bool:
    if not origin.publisher:  # what the chain says is part of each recording
        return True
    if isinstance(order.topics, list):
        return origin.topic in order.topics
    return order.topics == "all" or not origin.is_picture


def box_topics(config: BridgeConfig) -> dict[str, float]:
    """Return the topics of the black box, each with the least time between two messages (s)."""
    topics = config.topics
    namespace = config.ros.namespace if isinstance(config.ros, Ros2) else ""
    plain = [
        topics.drive.name,
        topics.odometry.name,
        *(scan.topic for scan in topics.scans),
        *(sonar.topic for sonar in topics.sonars),
        *(
            topic.name
            for topic in (topics.joint_states, topics.battery, topics.diagnostics, topics.map)
            if topic is not None
        ),
        f"{namespace}/tf",
        f"{namespace}/tf_static",
    ]
    if topics.navigation is not None:
        plain += [topics.navigation.velocity, topics.navigation.pose]
        plain += [topics.navigation.plan] if topics.navigation.plan else []
    pictures = {camera.topic: picture_gap_s(camera.type) for camera in topics.cameras}
    infos = [camera.info for camera in topics.cameras if camera.info]
    return dict.fromkeys([*plain, *infos], 0.0) | pictures
