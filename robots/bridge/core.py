"""The bridge's decisions: who may drive, which twist is sent, when the robot must stand still.

`Core` is the one place where lease, dead-man, stop, audit and gate meet. It knows no socket, no ROS and no clock: time
is an argument (monotonic seconds), the base is a small protocol. Everything runs on one thread.
"""

from __future__ import annotations

import logging
import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Literal, Protocol
from uuid import UUID

from msgspec import Struct, structs

from robots import wire
from robots.bridge import state_view
from robots.bridge.audit.records import Records, Requester, unrecorded
from robots.bridge.config import BridgeConfig
from robots.bridge.drive.drive_input import DriveInput, stick_of, velocity_of
from robots.bridge.drive.drive_log import WAITING, DriveLog
from robots.bridge.drive.input_filters import COMMAND_LIFE_S
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.geometry.arm_discs import Posture
from robots.bridge.gate.obstacles.depth_camera import Frame
from robots.bridge.gate.values import STILL, LaserScan, Pose, Velocity, Verdict
from robots.bridge.lease.lease_guard import LeaseGuard
from robots.bridge.lease.state_store import Persisted
from robots.bridge.overload import LoopLateness
from robots.bridge.tasks.goals import CANCEL_AGAIN_S
from robots.bridge.tasks.publishing import Publisher
from robots.bridge.tasks.tasks import TaskPerformer, Tasks, holder_of
from robots.wire import Drive, Ended, Grant, Refusal, StopState

log = logging.getLogger(__name__)

QUIET_AFTER_S = 1.0  # zeros are repeated this long after control ended, then the topic is left to others
ODOMETRY_ONLINE_S = 1.0
PRESSES_KNOWN = 1000  # the newest; a press that is delivered twice comes twice within seconds
AT_ONCE_S = 0.05
PRESS_KEPT_S = 60.0  # a press that a watchdog heard longer ago may be of another run of this computer
REACHED_S = 1.0  # after joining the master: whoever listens to cancels is connected by then

_IDLE = Verdict(STILL, STILL, "idle", "")
# Refusals that come while the stick is out: what asks for motion since then does not count once they are over.
_HALTING = {
    "motion_running": "nothing drives during a motion",
    "not_recorded": "what the robot did could not be recorded",
}


class Base(TaskPerformer, Protocol):
    """The commands that the core may send to the robot."""

    def publish(self, velocity: Velocity) -> None:
        """Send a twist on the drive topic."""

    def cancel_all(self) -> None:
        """Cancel every goal of every action in `Topics.cancel_on_stop`, whoever sent it."""

    def acknowledged_s(self, now_s: float) -> float | None:
        """How long the robot's machine takes to acknowledge a twist; None if nothing new shows it."""

    @property
    def listeners(self) -> int:
        """How many nodes listen to the drive topic."""


class RosStatus(Struct, frozen=True):
    """How the connection to the robot's master is, as its watcher sees it."""

    phase: Literal["waiting", "refused", "connecting"]
    text: str
    foreign: list[str] = []
    problems: list[str] = []


class Reported(Struct):
    """The newest reports of the robot."""

    odometry: tuple[float, Pose, Velocity] | None = None  # when it arrived, and what it said
    battery_percent: float | None = None
    charging: bool | None = None
    skew_s: float | None = None  # of its clock against ours, steadied


class Core:
    """One robot's rules. `announce` hands a report to every link; stops are numbered from `stops_before` on.

    `on_scan` is called once a scan is in: a picture drawn then is the freshest. `on_news` is called when a sensor told
    something while somebody may drive: `prepare` then spares the next command the work.
    """

    def __init__(
        self,
        config: BridgeConfig,
        base: Base,
        gate: Gate,
        records: Records,
        drives: DriveLog,
        left: Persisted,
        announce: Callable[[Ended | wire.Offers], None],
        publisher: Publisher,
        stops_before: int = 0,
        on_scan: Callable[[], None] = lambda: None,
        on_news: Callable[[], None] = lambda: None,
    ) -> None:
        self.config = config
        self.lease = LeaseGuard(left.fence)
        self.stop_state = StopState("clear", number=stops_before)
        if left.latched:  # whether the robot stands, nobody has seen yet
            self.stop_state = StopState("stopping", left.by or None, left.reason, number=stops_before)
        self.refused: Counter[str] = Counter()
        self._base = base
        self._gate = gate
        self._records = records
        self._drives = drives
        self._announce = announce
        self._on_scan = on_scan
        self._on_news = on_news
        self._stick = DriveInput(self.config.stick)
        self._twists = (
            DriveInput()
        )  # velocities that the holder's tools ask for, where the stick asks for none
        self._page_gone_s: float | None = None
        self._unrecorded: Refusal | None = None  # why nothing goes on: it could not be recorded
        self._asking: DriveInput | None = None  # the one that asks for motion
        self._passed = STILL  # what of it reached the gate
        self._sent = STILL
        self._publish_until_s = float("-inf")
        self._stop_latched_s: float | None = None  # None: before this process began
        self._stop_pressed_s: float | None = None  # and when somebody pressed it; None: not known
        self._stop_press: UUID | None = None  # the first one of this stop
        self._presses: deque[UUID] = deque(maxlen=PRESSES_KNOWN)  # that need not stop again
        self._cancelling = left.latched  # everybody's goals, again and again
        self._cancelled_s = float("-inf")
        self._joined_s = float("inf")  # the robot's master
        self._late = LoopLateness("bridge")
        self._console_late = LoopLateness("console")
        self.alone = False  # without a watchdog
        self._silent: tuple[DriveInput, float] | None = (
            None  # whose last command died, and when that was noticed
        )
        self._verdict = _IDLE
        self._ros = RosStatus("waiting", "The bridge is starting.")
        self._reported = Reported()
        self._run = 0  # of the robot
        self._sonar_reach_m = {sonar.frame_id: sonar.max_range_m for sonar in config.topics.sonars}
        self.tasks = Tasks(config, base, gate, records, self, publisher, announce)

    # --- control ---------------------------------------------------------------------------------

    def grant(self, grant: Grant, link: int, now_s: float) -> None:
        """Put a checked grant in force. A new holder, or a page that came back, starts with a neutral stick."""
        current = self.lease.current
        if current is None or grant.fence != current.fence:
            self._end_control("Control was given to somebody else.", now_s)
            self._count_anew()
            self._owe_neutral("control_taken", "you have just taken control")
        elif self._page_gone_s is not None or link != self.lease.link:
            self._count_anew()
            self.halt("page_back", "the page came back", now_s)
        self._page_gone_s = None
        self._gate.observe_operator(grant.delay_s)
        self.lease.take(grant, link, now_s)

    def revoke(self, fence: int, reason: str, now_s: float) -> None:
        """End control under `fence`."""
        if self.lease.current and self.lease.current.fence == fence:
            self._end_control(reason, now_s)

    def hold(self, fence: int, reason: str, link: int, now_s: float, code: str = "page_gone") -> None:
        """The holder's page is gone: zero now. A page that comes back counts its commands anew, and orders anew.

        By another link than the grant's it is late news: the page is back, by that one.
        """
        if self.lease.current is None or (self.lease.current.fence, self.lease.link) != (fence, link):
            return
        self._page_gone_s = now_s
        self._count_anew()
        self.halt(code, reason, now_s)
        self.tasks.page_left(now_s)

    def link_lost(self, link: int, now_s: float) -> None:
        """A web process is gone. If control came through it, zero now; the grant runs out by itself."""
        if self.lease.current:
            reason = "the console lost its link to the robot"
            self.hold(self.lease.current.fence, reason, link, now_s, "link_lost")

    def drive(self, drive: Drive, link: int, now_s: float) -> Refusal | None:
        """A stick position: publish at once what the gate allows of it. Returns why nothing of it was, if so."""
        refusal = self.lease.refuse_drive(drive.fence, link, now_s) or self._stick.take(drive, now_s)
        if refusal is None:
            refusal = self._decide(now_s)
        if refusal is not None:
            self.refused[refusal.code] += 1
        return refusal

    def twist(self, velocity: Velocity, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """A velocity from the holder's tools: as if the stick had asked for it."""
        if order.sent_ms is None:
            text = "A velocity needs sent_ms, the sender’s monotonic clock: old ones are not carried out."
            return Refusal("invalid", text, "wire")
        limits = self.config.gate.limits
        stick = stick_of(velocity, limits, grant.max_share, self.config.reverse_steering)
        drive = Drive(order.fence, order.seq, order.sent_ms, stick.x, stick.w, stick.y, share=1.0)
        return self._twists.take(drive, now_s) or self._decide(now_s)

    def stop(
        self, by: str, reason: str, now_s: float, press: UUID | None = None, *, waited: bool = False
    ) -> None:
        """Emergency stop: zero at once, latched, everybody's goals cancelled. Each press is one of its own.

        A press that arrives again, by another way or late, changes nothing: it may have been cleared meanwhile.
        """
        if press in self._presses:
            return
        if press is not None:
            self.know([press])
        stop = self.stop_state
        is_first = stop.state == "clear"
        if is_first:
            stands = self._passed == self._sent == STILL and self._gate.standstill(now_s) is True
            stop = StopState("stopping", number=stop.number, was_standing=stands)
            self._stop_latched_s = now_s
            self._stop_pressed_s = None if waited else now_s
            self._stop_press = press
        self.stop_state = structs.replace(stop, by=by, reason=reason, number=stop.number + 1)
        self.halt("stopped", "the robot was stopped", now_s)
        self._cancelling = True
        self._cancel_all(now_s)
        self.tasks.stopped(by, now_s)
        self._verdict = Verdict(STILL, STILL, "stopped", f"Stopped by {by}.")
        if is_first:
            grant = self.lease.current
            self._records.stopped(
                holder_of(grant) if grant else None, stop.number + 1, stop.was_standing, now_s
            )

    def stopped_elsewhere(
        self, by: str, reason: str, press: UUID | None, now_s: float, pressed_s: float | None = None
    ) -> None:
        """The watchdog holds a stop: one that it heard, or (`press` None) one that an earlier bridge had latched.

        It heard it at `pressed_s`: this process may have been held up since, or begun only now.
        """
        stop = self.stop_state
        if press is None and stop.state != "clear" and (stop.by or "", stop.reason) == (by, reason):
            return  # the state file told of it as well
        self.stop(by, reason, now_s, press)
        if press == self._stop_press and self._stop_pressed_s is not None:
            self._pressed_at(pressed_s if pressed_s and 0.0 <= now_s - pressed_s < PRESS_KEPT_S else None)

    def _pressed_at(self, pressed_s: float | None) -> None:
        """The present stop was pressed then, and not when this process heard of it. None: nobody knows when."""
        heard_s, self._stop_pressed_s = self._stop_pressed_s, pressed_s
        took_ms = self.stop_state.standstill_ms
        if took_ms is not None and heard_s is not None:
            took_ms = None if pressed_s is None else took_ms + round((heard_s - pressed_s) * 1000)
            self.stop_state = structs.replace(self.stop_state, standstill_ms=took_ms)

    def know(self, presses: Sequence[UUID]) -> None:
        """These presses need not stop the robot any more."""
        self._presses.extend(presses)

    def clear(self, number: int, now_s: float, presses: Sequence[UUID] = ()) -> Refusal | None:
        """Release the latch of stop `number`; nothing moves by it. Returns why not, if another was pressed since.

        `presses` are older than this clear and may still be on their way: they do not stop any more.
        """
        stop = self.stop_state
        if number != stop.number:
            text = f"The stop was pressed again since{f', by {stop.by}' if stop.by else ''}: look, then clear that one."
            return Refusal("stopped_again", text, "stop", {"number": number, "newest": stop.number})
        self.stop_state = StopState("clear", number=stop.number)
        self.know(presses)
        self._stop_latched_s = self._stop_pressed_s = self._stop_press = None
        self.halt("stop_cleared", "the stop was cleared", now_s)
        self._cancel_all(now_s)
        self._verdict = _IDLE
        return None

    def tick(self, now_s: float, late_s: float = 0.0) -> None:
        """Every period: expiry, dead-man, the gate's newest word, zeros. `late_s` after it was due."""
        self._late.observe(late_s, now_s)
        self._console_late.observe(0.0, now_s)
        self._expire(now_s)
        took_s = self._base.acknowledged_s(now_s)
        if took_s is not None:
            self._gate.observe_acknowledgement(took_s, now_s)
        still = self._gate.standstill(now_s)
        if still is None:
            self._drives.halted("nothing new came from odometry")
        self._records.tick(now_s, watched=self._drives.under_way or bool(self.tasks.under_way))
        self._drives.tick(now_s, self._passed == STILL and still is not False)
        self._watch_records(now_s)
        self._decide(now_s)
        self.tasks.tick(self._sent, self._page_gone_s, now_s)
        if self.stop_state.state == "stopping" and self._reported.odometry:
            self._see_standstill(still, self._reported.odometry[0])
        self._repeat_cancel(now_s)

    def console_was_late(self, late_s: float, now_s: float) -> None:
        """A web process's loop woke late: do not blame the operator for silence in that time."""
        self._console_late.observe(late_s, now_s)
        if self._silent and now_s - self._silent[1] < late_s:
            stick, noticed_s = self._silent
            code, reason = self._why_silent(stick, noticed_s)
            for owing in (self._stick, self._twists):
                if owing.owes and owing.owes.code == "dead_man":
                    owing.owes = wire.NeutralNeeded(code, reason)

    def recorded(self, now_s: float) -> None:
        """A record is in: what waited for it need not wait for the next tick."""
        self._expire(now_s)
        self._decide(now_s)
        self.tasks.tick(self._sent, self._page_gone_s, now_s)

    @property
    def hurries(self) -> bool:
        """Whether what sensors tell is needed at once, and not only at the next tick. May be asked on any thread."""
        return self.lease.current is not None or self.stop_state.state == "stopping"

    def publishing(self, now_s: float) -> bool:
        """Whether twists go out: for control, a stop, or the moment after."""
        return now_s < self._publish_until_s

    def close(self, now_s: float) -> None:
        """The bridge ends: nobody has control any more, and nothing begins."""
        self.tasks.close(now_s)
        self._drives.end("bridge_ended", "the bridge ended", now_s)
        self.lease.end()

    # --- what the robot says ---------------------------------------------------------------------

    def ros_status(self, status: RosStatus, now_s: float) -> None:
        """The master came or went, or a survey of the robot's topics is in."""
        if status.phase != self._ros.phase:
            log.info("ROS: %s: %s", status.phase, status.text)
        joined, was_joined = status.phase == "connecting", self._ros.phase == "connecting"
        self._ros = status
        if joined and not was_joined:
            self._joined_s = now_s
        elif was_joined and not joined:
            self._joined_s = float("inf")
            self.halt("robot_offline", "the robot’s ROS master was lost", now_s)

    def odometry(
        self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity, wall_s: float, run: int = 0
    ) -> None:
        """One odometry message; `wall_s` is this machine's time of day at arrival, for the clocks' skew.

        `run`: another number for another publisher, and for another run of the robot's master.
        """
        if not all(math.isfinite(value) for value in (*pose, *velocity)):
            self.refused["odometry_not_finite"] += 1
            return
        if run != self._run:
            self._run = run
            self._gate.forget(anew=True)
        if not self._gate.observe_odometry(stamp_s, arrival_s, pose, velocity):
            return  # frozen, or overtaken: as if nothing had come
        self._reported.odometry = (arrival_s, pose, velocity)
        skew_s, steadied_s = stamp_s - wall_s, self._reported.skew_s
        self._reported.skew_s = skew_s if steadied_s is None else steadied_s + 0.1 * (skew_s - steadied_s)
        self._drives.moved(pose, velocity, arrival_s)
        self._tell_news()

    def laser(self, scan: LaserScan) -> None:
        """One scan."""
        self._gate.observe_scan(scan)
        self._tell_news()
        self._on_scan()

    def range(self, source: str, stamp_s: float, arrival_s: float, range_m: float) -> None:
        """One sonar reading."""
        max_range_m = self._sonar_reach_m.get(source, math.inf)
        self._gate.observe_range(source, stamp_s, arrival_s, range_m, max_range_m)
        self._tell_news()

    def depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        """One picture of the depth camera."""
        self._gate.observe_depth(frame, stamp_s, arrival_s)
        self._tell_news()

    def posture(self, arm: Posture, arrival_s: float) -> None:
        """Where the arm is."""
        self._gate.observe_posture(arm, arrival_s)

    def bad_depth(self, why: str) -> None:
        """A picture of the depth camera that cannot be used, and why."""
        self._gate.observe_bad_depth(why)

    def battery(self, percent: float) -> None:
        """Charge in percent."""
        if math.isfinite(percent):
            self._reported.battery_percent = min(max(percent, 0.0), 100.0)

    def charging(self, charging: bool) -> None:
        """Whether the robot is on its charger."""
        self._reported.charging = charging

    def prepare(self, now_s: float) -> None:
        """Let the gate reckon now what a command would wait for."""
        self._gate.prepare(now_s)

    def _tell_news(self) -> None:
        if self.lease.current:
            self._on_news()

    # --- what is told of it ------------------------------------------------------------------------

    def persisted(self) -> Persisted:
        """The state that must survive a kill."""
        stop = self.stop_state
        return Persisted(stop.state != "clear", stop.by or "", stop.reason, self.lease.highest)

    def hello(self) -> wire.BridgeHello:
        """First word to a web process. It needs nothing that the robot tells."""
        return wire.BridgeHello(wire.PROTOCOL, self.config.robot_id, self.config.slug, self.lease.highest)

    def headline(self, now_s: float) -> tuple[object, ...]:
        """The part of the state that is told at once when it changes."""
        grant, tasks = self.lease.current, self.tasks
        motion, speech = tasks.motions.view(now_s), tasks.speech.view(now_s)
        return (
            *self._phase(now_s),
            self.stop_state,
            grant and (grant.fence, self._neutral_needed),
            motion and motion.name,
            tasks.motions.last,
            speech and (speech.number, speech.status, speech.word),
            tasks.speech.last,
            tasks.routing.chosen,
            dict(tasks.routing.gone),
            tasks.publications.view,
        )

    @property
    def _neutral_needed(self) -> wire.NeutralNeeded | None:
        return (self._asking or self._stick).owes

    def state(self, now_s: float, watchers: list[str], watchers_more: int = 0) -> wire.State:
        """The robot as it is now."""
        phase, text = self._phase(now_s)
        told = self._reported
        inputs = state_view.StateInputs(
            phase=phase,
            text=text,
            stop=self.stop_state,
            grant=self.lease.current,
            seq=self._stick.seq,
            neutral_needed=self._neutral_needed,
            foreign=self._ros.foreign,
            verdict=self._verdict,
            refused=self.refused,
            odometry=told.odometry,
            battery_percent=told.battery_percent,
            charging=told.charging,
            skew_s=told.skew_s,
            overload=self._late.told(now_s) or self._console_late.told(now_s),
            alone=self.alone,
        )
        return state_view.state(inputs, self._gate, self.tasks, now_s, watchers, watchers_more)

    # --- what orders must know (orders.Rules) ------------------------------------------------------

    def why_closed(self, now_s: float) -> Refusal | None:
        """Why nothing is passed on to the robot, whoever asks: the stop is latched, it is away, nothing is recorded."""
        if self.stop_state.state != "clear":
            return Refusal("stopped", "The robot is stopped: clear the stop first.", "stop")
        phase, text = self._phase(now_s)
        if phase != "online":
            return Refusal("robot_offline", text, "robot")
        return self._unrecorded

    def why_not_begin(self, requester: Requester, now_s: float) -> Refusal | None:
        """Why what was asked for may not begin now: control is elsewhere, nobody is there, or the robot is closed."""
        refusal = self.lease.refuse_drive(requester.holder.fence, requester.link, now_s)
        if refusal is None and self._page_gone_s is not None:
            refusal = Refusal("link_lost", "The console lost its link to the robot.", "lease")
        return refusal or self.why_closed(now_s)

    def why_not_still(self, now_s: float) -> Refusal | None:
        """The base moves, or is told to, or nobody knows."""
        still = self._gate.standstill(now_s)
        if self._passed != STILL or still is False:
            return Refusal("base_moving", "The robot drives: let it stand still first.", "robot")
        if still is None:
            text = "Whether the robot stands still is not known: its odometry is late."
            return Refusal("base_moving", text, "robot")
        return None

    def halt(self, code: str, reason: str, now_s: float) -> None:
        """Zero now, and a neutral stick before anything moves again."""
        self._need_neutral(code, reason)
        self._asking, self._passed = None, STILL
        self._publish_until_s = now_s + QUIET_AFTER_S
        self._send(STILL, now_s)

    # --- inside ----------------------------------------------------------------------------------

    def _decide(self, now_s: float) -> Refusal | None:
        """Publish what is right now. Returns why a stick that asks for motion gets none, if a rule forbids it."""
        grant = self.lease.current
        if self._asking and self._asking.current(now_s) is None:
            self._silent = self._asking, now_s
            self._need_neutral(*self._why_silent(self._asking, now_s))
        awaited = self._awaited(now_s)
        self._asking, asked = self._wanted(grant, awaited is None, now_s) if grant else (None, STILL)
        refusal = self._why_not(grant, self._asking, now_s) if grant and self._asking else None
        self._passed = asked if refusal is None else STILL
        verdict = self._gate.decide(self._passed, self._sent, now_s)
        if self._passed != STILL:
            self._drives.decided(verdict, now_s)
            if verdict.neutral:
                self._need_neutral(verdict.code, verdict.text)
        if refusal and refusal.code in _HALTING:
            self._need_neutral(refusal.code, _HALTING[refusal.code])
        if self._asking and awaited:
            self._need_neutral(awaited.code, awaited.text)
        if told := refusal or self._unrecorded:
            verdict = verdict._replace(asked=asked, code=told.code, text=told.text)
        if self.stop_state.state == "clear":
            self._verdict = verdict
        self._send(verdict.velocity if self._passed != STILL else STILL, now_s)
        return None if refusal is WAITING else refusal

    def _why_silent(self, stick: DriveInput, now_s: float) -> tuple[str, str]:
        """Why no command of `stick` is young enough: this computer, where its lateness explains it, else the sender."""
        for late, part in ((self._late, "the bridge"), (self._console_late, "the console")):
            late_s = late.since(now_s - AT_ONCE_S)  # else what came meanwhile has been read
            if late_s and now_s - stick.taken_s - late_s < COMMAND_LIFE_S:
                return "overloaded", f"this computer is overloaded: {part} was {late_s:.1f} s late"
        return "dead_man", f"no command came for {COMMAND_LIFE_S} s"

    def _watch_records(self, now_s: float) -> None:
        """Stop everything that cannot be recorded. A task that waited for its record does not begin late."""
        why = self._records.overdue(now_s)
        if why is None:
            self._unrecorded = None
        elif self._unrecorded is None:
            self._unrecorded = unrecorded(why, self.tasks.under_way)
            self.tasks.unrecorded(self._unrecorded, now_s)

    def _awaited(self, now_s: float) -> wire.NeutralNeeded | None:
        """The part of the robot that must be back before a stick in the middle counts, or before one that is out does.

        Else a stick that is pushed while a sensor is silent would drive off by itself once it is back.
        """
        if self._phase(now_s)[0] != "online":
            return wire.NeutralNeeded("robot_offline", "the robot was away")
        fault = self._gate.fault(now_s)
        return wire.NeutralNeeded(fault.code, f"stopped: {fault.text}") if fault else None

    def _wanted(self, grant: Grant, middle_counts: bool, now_s: float) -> tuple[DriveInput | None, Velocity]:
        """The requested velocity and its source: the page's stick, or a twist while the stick rests.

        One that is in the middle, if that counts, has done what it owes, and so has another that was not out when it
        was last seen.
        """
        limits, steering = self.config.gate.limits, self.config.reverse_steering
        wanted = {
            stick: velocity_of(drive, limits, grant.max_share, steering)
            for stick in (self._stick, self._twists)
            if (drive := stick.current(now_s))
        }
        for stick, velocity in wanted.items():
            stick.is_out = velocity != STILL
        if middle_counts and STILL in wanted.values():
            for stick in (self._stick, self._twists):
                if not stick.is_out:
                    stick.owes = None
        return next(((stick, velocity) for stick, velocity in wanted.items() if stick.is_out), (None, STILL))

    def _count_anew(self) -> None:
        """Commands come from another page, or from one that was loaded again."""
        self._stick = DriveInput(self.config.stick)
        self._twists = DriveInput()

    def _why_not(self, grant: Grant, stick: DriveInput, now_s: float) -> Refusal | None:
        """The first rule that forbids motion, lease and age apart."""
        if closed := self.why_closed(now_s):
            return closed
        if refusal := self.tasks.why_stand(now_s) or self._drives.why_not:
            return refusal
        if stick.owes:
            what = (
                "Let the stick return to the middle"
                if stick is self._stick
                else "Publish a velocity of zero first"
            )
            text = f"{what}: {stick.owes.text}."
            return Refusal("neutral_needed", text, "dead-man", {"because": stick.owes.code})
        return self._drives.may_move(holder_of(grant), now_s)

    def _send(self, velocity: Velocity, now_s: float) -> None:
        """Publish while there is a reason to; then leave the topic to others."""
        if self.lease.current or self.stop_state.state != "clear":
            self._publish_until_s = now_s + QUIET_AFTER_S
        if now_s < self._publish_until_s:
            self._base.publish(velocity)
        self._sent = velocity

    def _need_neutral(self, code: str, reason: str) -> None:
        """Something other than the operator stops the robot: a neutral stick before it moves again."""
        self._drives.halted(reason)
        self._owe_neutral(code, reason)

    def _owe_neutral(self, code: str, reason: str) -> None:
        for stick in (self._stick, self._twists):
            stick.owe(code, reason)

    def _expire(self, now_s: float) -> None:
        """A grant that has run out is over, whichever comes first of the tick and what was waited for."""
        if self.lease.expired(now_s):
            self._end_control("Control was not renewed in time.", now_s)

    def _end_control(self, reason: str, now_s: float) -> None:
        ended = self.lease.end()
        if ended is None:
            return
        self.halt("control_ended", reason, now_s)
        self.tasks.control_ended(reason, now_s)
        self._announce(Ended(ended.fence))

    def _repeat_cancel(self, now_s: float) -> None:
        """A cancel may reach nobody: the master is away, or a listener not connected yet. And others ask for more.

        So it is repeated while the stop is latched; if it was cleared before the robot could be reached, until then.
        """
        if not self._cancelling:
            return
        if now_s - self._cancelled_s >= CANCEL_AGAIN_S:
            self._cancel_all(now_s)
        self._cancelling = self.stop_state.state != "clear" or now_s - self._joined_s < REACHED_S

    def _cancel_all(self, now_s: float) -> None:
        """Cancel everybody's goals. A failed cancel must not block the stop."""
        self._cancelled_s = now_s
        try:
            self._base.cancel_all()
        except Exception:
            log.exception("goals were not cancelled")

    def _see_standstill(self, still: bool | None, seen_s: float) -> None:
        """Odometry that came at `seen_s` shows standstill: it ends a stop that was pressed before."""
        latched_s, pressed_s = self._stop_latched_s, self._stop_pressed_s
        if still is False:
            self.stop_state = structs.replace(self.stop_state, was_standing=False)
        elif still and (latched_s is None or seen_s > latched_s):
            took_ms = None
            if pressed_s is not None and not self.stop_state.was_standing:
                took_ms = round((seen_s - pressed_s) * 1000)
            self.stop_state = structs.replace(self.stop_state, state="stopped", standstill_ms=took_ms)

    def _phase(self, now_s: float) -> tuple[wire.Phase, str]:
        """Where the robot is on the way to being drivable, and what is missing."""
        topics = self.config.topics
        if self._ros.phase != "connecting":
            return self._ros.phase, self._ros.text
        if self._base.listeners == 0:
            return "connecting", self._problem(f"Nothing on the robot listens to {topics.drive.name}.")
        odometry = self._reported.odometry
        if odometry is None or now_s - odometry[0] > ODOMETRY_ONLINE_S:
            return "connecting", self._problem(f"No odometry comes from {topics.odometry.name}.")
        return "online", self._ros.problems[0] if self._ros.problems else ""

    def _problem(self, otherwise: str) -> str:
        return self._ros.problems[0] if self._ros.problems else otherwise
