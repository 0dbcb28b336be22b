"""Decide which twist one robot receives: joins lease, dead-man, stop, audit and gate.

`Core` uses no socket, no ROS and no clock: time is an argument (monotonic seconds), and `Base` is the
protocol to the robot. Everything runs on one thread.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from uuid import UUID

from robots.bridge import state_view
from robots.bridge.audit.records import Records, Requester, unrecorded
from robots.bridge.drive.drive_input import DriveInput
from robots.bridge.drive.drive_log import WAITING, DriveLog, Held
from robots.bridge.drive.holder_inputs import HolderInputs
from robots.bridge.gate.arm.discs import Posture
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.obstacles.depth_camera import Frame
from robots.bridge.gate.values import BRIDGE_STARTED, Forgotten, LaserScan
from robots.bridge.gate.words import forgotten
from robots.bridge.lease.goal_cancels import GoalCancels
from robots.bridge.lease.lease_guard import LeaseGuard
from robots.bridge.lease.motion_after_stop import MotionAfterStop
from robots.bridge.lease.state_store import SavedState
from robots.bridge.lease.stop_latch import StopLatch
from robots.bridge.robot_clock import RobotClock
from robots.bridge.robot_reports import Base, RobotReports, RosStatus
from robots.bridge.steady_view import SteadyLimits, SteadyVerdict
from robots.bridge.tasks.holder_tasks import HolderTasks, holder_of
from robots.bridge.tasks.task import Activity, Publisher
from robots.shared import wire
from robots.shared.configuration.bridge_config import CLOCK_SKEW_S, BridgeConfig
from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.processes.durations import Durations
from robots.shared.processes.overload import LoopLateness
from robots.shared.records.record_sink import TakenDescription
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import Sentence, catalogued, joined, say, standing_alone
from robots.shared.wire import Drive, Ended, Grant, Refusal, StopState

log = logging.getLogger(__name__)

# zeros are repeated for this time after control has ended; then the topic is free for other nodes
QUIET_AFTER_S = 1.0
# A controller whose clock is behind keeps the last twist for so much longer than its time-out (PAL's: 0.25 s)
STAMP_SKEW_S = 0.1
READ_WITHIN_S = 0.05  # a message is read within this time after its arrival

_IDLE = Verdict(STILL, STILL, "idle", "")
# A refusal with one of these codes, or of a task in progress, while the stick is out, requires neutral: the robot must
# not start to move by itself when the cause ends.
_HALTING = {"not_recorded": say("the robot’s actions could not be recorded")}
BRIDGE_LATE = catalogued("this computer is overloaded: the bridge was {seconds:.1f} s late")
CONSOLE_LATE = catalogued("this computer is overloaded: the server was {seconds:.1f} s late")


class Core:
    """The rules of one robot.

    `announce` sends a report to every link. Stops are numbered from `stops_before` on. `on_scan` is called
    after each scan, to send a fresh view. `on_news` is called after each sensor message while somebody has
    control: `prepare` then does the gate's work before the next command needs it. `on_wake` is called when a rest
    ends: call `catch_up` soon. `recorded` returns the fields of `wire.State` about recordings.
    """

    def __init__(
        self,
        config: BridgeConfig,
        base: Base,
        gate: Gate,
        records: Records,
        drives: DriveLog,
        saved: SavedState,
        announce: Callable[[Ended | wire.Offers], None],
        publisher: Publisher,
        stops_before: int = 0,
        on_scan: Callable[[], None] = lambda: None,
        on_news: Callable[[], None] = lambda: None,
        on_wake: Callable[[], object] = lambda: None,
        recorded: Callable[[], Mapping[str, Any]] = lambda: {},
    ) -> None:
        self.config = config
        self.lease = LeaseGuard(saved.fence)
        self.latch = StopLatch(saved, stops_before)
        self.refused: Counter[str] = Counter()
        self.decisions = Durations()  # from reading a drive message to its twist
        self._base = base
        self._gate = gate
        self._records = records
        self._drives = drives
        self._announce = announce
        self._recorded = recorded
        self._on_scan = on_scan
        self._on_news, self._on_wake = on_news, on_wake
        self._inputs = HolderInputs(config)
        self.reports = RobotReports(config, base, records)
        self._after_stop = MotionAfterStop(config, records, base.joint)
        self._page_gone_s: float | None = None
        self._unrecorded: Refusal | None = None  # set while records cannot be written: nothing may move
        self._asking: DriveInput | None = None  # the input that asks for motion
        self._passed = STILL  # the requested twist that was passed to the gate
        self.sent = STILL  # the last twist to the base
        self._rests = False
        self._lags = False  # the rest has just ended: messages of sensors still wait
        self._publish_until_s = float("-inf")
        self._cancels = GoalCancels(base.cancel_all, saved.latched)
        self._late = LoopLateness("bridge")
        self._console_late = LoopLateness("console")
        self.watchdog_missing = False
        # an input whose last command expired, and when this was noticed
        self._silent: tuple[DriveInput, float] | None = None
        self._verdict = _IDLE
        self._steady_verdict, self._steady_limits = SteadyVerdict(), SteadyLimits()
        self._run = 0  # number of the robot's run
        # the last time at which memory was dropped, and when this was noticed: a new bridge knows nothing
        self._forgotten: tuple[Forgotten, float | None] = BRIDGE_STARTED, None
        self._sonar_reach_m = {sonar.frame_id: sonar.max_range_m for sonar in config.topics.sonars}
        self.tasks = HolderTasks(config, base, gate, records, self, publisher, announce, saved.goal)
        self._halting = _HALTING | self.tasks.neutral_words

    @property
    def stop_state(self) -> StopState:
        """The present stop."""
        return self.latch.state

    def moves_although_stopped(self, now_s: float) -> wire.MovesAlthoughStopped | None:
        """Return how the stopped robot moves; None: it obeys, or is not stopped."""
        return self._after_stop.view(self.reports.ros.velocities, now_s)

    # --- control ---------------------------------------------------------------------------------

    def grant(self, grant: Grant, link: int, now_s: float) -> None:
        """Put a checked grant in force. A new holder, or a page that came back, must send neutral first."""
        current = self.lease.current
        if current is None or grant.fence != current.fence:
            self._end_control(say("Control was given to somebody else."), now_s)
            log.info("fence %d has control", grant.fence)
            self._inputs.restart()
            self._inputs.require_neutral("control_taken", say("you have just taken control"))
            self._gate.observe_new_driver()
        elif self._page_gone_s is not None or link != self.lease.link:
            self._inputs.restart()
            self.halt("page_back", say("the page came back"), now_s)
        self._page_gone_s = None
        self._gate.observe_operator(grant.delay_s)
        self._gate.observe_camera_view(grant.camera_s)
        self.lease.enforce(grant, link, now_s)

    def revoke(self, fence: int, reason: Sentence, now_s: float) -> None:
        """End control under `fence`."""
        if self.lease.current and self.lease.current.fence == fence:
            self._end_control(reason, now_s)

    def pause(self, fence: int, reason: Sentence, link: int, now_s: float, code: str = "page_gone") -> None:
        """Pause control because the holder's page is gone: zero now.

        A page that comes back starts a new numbering of commands and tasks. A pause from another link than
        the grant's link is late and is ignored: the page has already come back through the other link.
        """
        if self.lease.current is None or (self.lease.current.fence, self.lease.link) != (fence, link):
            return
        self._page_gone_s = now_s
        self._inputs.restart()
        self.halt(code, reason, now_s)
        self.tasks.page_left(now_s)

    def link_lost(self, link: int, now_s: float) -> None:
        """Handle the loss of a web process: zero now, if control came through it. The grant expires by itself."""
        if self.lease.current:
            reason = say("the server lost its link to the robot")
            self.pause(self.lease.current.fence, reason, link, now_s, "link_lost")

    @property
    def held(self) -> Held | None:
        """The gate's intervention in progress."""
        return self._drives.held

    @property
    def verdict(self) -> wire.Verdict:
        """The gate's answer to the last command."""
        return state_view.verdict(self._verdict, ())

    def drive(self, drive: Drive, link: int, now_s: float) -> Refusal | None:
        """Take a stick position and publish the twist that the gate allows at once. Return the refusal, if any."""
        refusal = self.lease.refuse_command(drive.fence, link, now_s) or self._inputs.stick.accept(
            drive, now_s
        )
        if refusal is None:
            refusal = self._decide(now_s)
        if refusal is not None:
            self.refused[refusal.code] += 1
        return refusal

    def twist(self, velocity: Velocity, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """Take a velocity from a program of the holder. It passes the same rules as a stick position."""
        return self._inputs.take_twist(velocity, order, grant, now_s) or self._decide(now_s)

    def stop(
        self, by: str, reason: str, now_s: float, press: UUID | None = None, *, waited: bool = False
    ) -> None:
        """Stop the robot (emergency stop): zero at once, latch, cancel all goals. Each press counts as one stop.

        If a press arrives again (late or by another way), it is ignored: the stop may already have been
        cleared.
        """
        if self.latch.was_handled(press):
            return
        is_first = not self.latch.latched
        stands = is_first and self._passed == self.sent == STILL and self._gate.standstill(now_s) is True
        self.latch.press(by, reason, now_s, press, stands=stands, waited=waited)
        self._cancels.repeat()
        try:
            self._zero("stopped", say("the robot was stopped"), now_s)
        finally:  # also if this zero fails: the same press is not handled again
            self._cancels.send(now_s)
            self.tasks.stopped(by, now_s)
        self._tell(Verdict(STILL, STILL, "stopped", say("Stopped by {by}.", by=by)), now_s)
        if is_first:
            grant, stop = self.lease.current, self.stop_state
            self._records.record_stop(
                holder_of(grant) if grant else None, stop.number, stop.was_standing, now_s
            )

    def stop_from_watchdog(
        self, by: str, reason: str, press: UUID | None, now_s: float, pressed_s: float | None = None
    ) -> None:
        """Take a stop from the watchdog: a new press, or (`press` None) a stop that an earlier bridge had latched.

        The watchdog received the press at `pressed_s`. Since then, this process was perhaps blocked or not
        yet started.
        """
        if press is None and self.latch.is_stopped_by(by, reason):
            return  # this stop was already in the state file
        self.stop(by, reason, now_s, press)
        self.latch.correct_time(press, pressed_s, now_s)

    def cancelled_by_watchdog(self, silent_s: float, now_s: float) -> None:
        """Note that the watchdog cancelled all goals, because this process was silent for `silent_s`."""
        text = standing_alone(say(BRIDGE_LATE, seconds=silent_s))
        self.tasks.navigation.end("overloaded", text, now_s)

    def clear(self, number: int, now_s: float, presses: Sequence[UUID] = ()) -> Refusal | None:
        """Clear stop `number`; this moves nothing. Return a refusal if somebody has pressed stop again.

        `presses` are older than this clear. They may arrive later and are then ignored.
        """
        if refusal := self.latch.clear(number, presses):
            return refusal
        self.halt("stop_cleared", say("the stop was cleared"), now_s)
        self._watch_stopped(now_s)
        self._cancels.send(now_s)
        self._tell(_IDLE, now_s)
        return None

    def tick(self, now_s: float, late_s: float = 0.0) -> None:
        """Run the periodic work: expiry, dead-man, the gate's decision, zeros.

        The tick comes `late_s` after it was due.
        """
        self._late.observe(late_s, now_s)
        self._console_late.observe(0.0, now_s)
        self._expire(now_s)
        self._note_forgotten(now_s)
        took_s = self._base.acknowledged_s(now_s)
        if took_s is not None:
            self._gate.observe_acknowledgement(took_s, now_s)
        still = self._gate.standstill(now_s)
        if still is None:
            self._drives.halted(say("no new odometry arrived"))
        self._records.tick(now_s, watched=self._drives.under_way or bool(self.tasks.under_way))
        drives_itself = self.tasks.navigation.driving_requester is not None
        self._drives.tick(now_s, self._passed == STILL and still is not False and not drives_itself)
        self._watch_records(now_s)
        self._decide(now_s)
        self.tasks.tick(self._page_gone_s, now_s)
        if self.reports.odometry:
            self.latch.observe(still, self.reports.odometry[0])
        self._watch_stopped(now_s)
        self._cancels.tick(self.latch.latched, now_s)
        self.reports.tick(now_s)
        self._rests = self._may_rest(still, now_s)

    def repeat_zero(self, now_s: float, late_s: float = 0.0) -> None:
        """Publish zero between two ticks of a robot at rest under control. A late sensor ends the rest."""
        self._late.observe(late_s, now_s)
        self._send(STILL, now_s)
        if self._gate.odometry_is_stale(now_s):
            self._base.take_odometry()
        if not self._gate.hears_all(now_s):
            self._end_rest()

    def console_was_late(self, late_s: float, now_s: float) -> None:
        """Note that a web process's loop was late: silence in this time is not the operator's fault."""
        self._console_late.observe(late_s, now_s)
        if self._silent and now_s - self._silent[1] < late_s:
            stick, noticed_s = self._silent
            code, reason = self._explain_silence(stick, noticed_s)
            self._inputs.correct_reason(code, reason)

    def recorded(self, now_s: float) -> None:
        """Begin work whose record was just written, without waiting for the next tick."""
        self._end_rest()
        self.catch_up()
        self._expire(now_s)
        self._decide(now_s)
        self.tasks.tick(self._page_gone_s, now_s)

    @property
    def drives_itself(self) -> bool:
        """Return whether navigation drives the robot, or may still do so.

        Then the watchdog must stop the robot if this process ends.
        """
        return self.tasks.navigation.driving_requester is not None or self.tasks.navigation.hold.holds

    @property
    def robot_clock(self) -> RobotClock:
        """Return the robot's clock, compared with ours by its odometry."""
        simulated = self._gate.latency.clock_is_simulated
        return RobotClock(None if simulated else self.reports.skew_s, simulated)

    @property
    def clocks_agree(self) -> bool:
        """Return whether stamps of our time may go to the robot, as far as its odometry tells.

        A controller whose clock is ahead would take no velocity; one whose clock is behind would go on for as long
        after the last one.
        """
        return abs(self.reports.skew_s or 0.0) <= STAMP_SKEW_S

    @property
    def in_use(self) -> bool:
        """Return whether somebody has control, or a stop is being carried out. Thread-safe."""
        return self.lease.current is not None or self.stop_state.state == "stopping"

    @property
    def rests(self) -> bool:
        """Return whether somebody has control, but the robot stands and nothing asks it to move. Thread-safe.

        What its sensors send may wait then for the next tick: the gate judges no motion before it is taken. Each
        motion begins with a record, during which there is time for this.
        """
        return self._rests

    @property
    def needs_fresh_sensors(self) -> bool:
        """Return whether sensor messages must be handled at once, not only at the next tick. Thread-safe."""
        return self.in_use and not self._rests

    def publishing(self, now_s: float) -> bool:
        """Return whether twists are published: during control, a stop, and shortly after both."""
        return now_s < self._publish_until_s

    def close(self, now_s: float) -> None:
        """End control and tasks: the bridge process ends."""
        self.tasks.close(now_s)
        self._after_stop.close(now_s)
        self._drives.end_drive("bridge_ended", say("the bridge ended"), now_s)
        self.lease.end_grant()

    # --- reports from the robot -------------------------------------------------------------------

    def ros_status(self, status: RosStatus, now_s: float) -> None:
        """Take a new state of the ROS connection: robot joined or lost, or topics surveyed again."""
        was_joined = self.reports.is_joined
        self.reports.take_status(status)
        if self.reports.is_joined and not was_joined:
            self._cancels.joined(now_s)
        elif was_joined and not self.reports.is_joined:
            self._cancels.lost()
            self.halt("robot_offline", say("the connection to the robot’s ROS was lost"), now_s)

    def follow_clock(self, *, simulated: bool) -> None:
        """Note whether the robot's clock is simulated: it runs slower or faster than ours, and pauses."""
        if simulated != self._gate.latency.clock_is_simulated:
            log.info("the robot's clock is %s", "simulated" if simulated else "a real one")
        self._gate.latency.follow_clock(simulated=simulated)

    def odometry(
        self,
        stamp_s: float,
        arrival_s: float,
        pose: Pose,
        velocity: Velocity,
        wall_s: float,
        run: int = 0,
        messages: int = 1,
    ) -> None:
        """Take one odometry message; `wall_s` is this computer's time of day at arrival, for the clock skew.

        `run` differs for another publisher and for another run of the robot's ROS. The message is the newest of so
        many `messages` that came together.
        """
        if not all(math.isfinite(value) for value in (*pose, *velocity)):
            self.refused["odometry_not_finite"] += 1
            return
        if run != self._run:
            self._run = run
            self._gate.forget(restarted=True, code="odometry_restarted")
        if self.tasks.navigation.driving_requester:
            # After a silence, messages arrive in a burst. The first are old: the robot only seems slow.
            self._miss_sensors(arrival_s)
        if not self._gate.observe_odometry(stamp_s, arrival_s, pose, velocity, messages):
            return  # repeated or out of order: ignore it
        before = self.reports.odometry
        self.reports.moved(pose, velocity, arrival_s, stamp_s - wall_s)
        self._drives.moved(pose, velocity, arrival_s)
        self.tasks.drives_by.moved(pose)
        self.tasks.navigation.moved(pose, velocity, arrival_s)
        if self.tasks.navigation.driving_requester:
            self._judge_navigation(arrival_s)
        if before is None or before[1:] != (pose, velocity):  # else obstacles are where they were
            self._report_changes()

    def odometry_alike(self, stamp_s: float, arrival_s: float) -> None:
        """Take an odometry message that shows the same as the next one, which waits already."""
        self._gate.observe_odometry_alike(stamp_s, arrival_s)

    def laser(self, scan: LaserScan, *, thins: bool = False) -> None:
        """Take a scan. `thins`: nobody looks at the robot, and it stands."""
        self._gate.observe_scan(scan, thins and not self.needs_fresh_sensors)
        self._report_changes()
        self._on_scan()

    def range(self, source: str, stamp_s: float, arrival_s: float, range_m: float) -> None:
        """Take one sonar reading."""
        max_range_m = self._sonar_reach_m.get(source, math.inf)
        self._gate.observe_range(source, stamp_s, arrival_s, range_m, max_range_m)
        self._report_changes()

    def depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        """Take one frame of the depth camera."""
        self._gate.observe_depth(frame, stamp_s, arrival_s)
        self._report_changes()

    def posture(self, arm: Posture, arrival_s: float) -> None:
        self._gate.observe_posture(arm, arrival_s)
        self.tasks.navigation.arm(arm.at_home, arrival_s)
        self.tasks.limbs.arm(arm.at_home, arrival_s)

    def bad_depth(self, why: str) -> None:
        """Note why a frame of the depth camera cannot be used."""
        self._gate.observe_bad_depth(why)

    def described(self, taken: TakenDescription, failed: Callable[[], object]) -> None:
        """Take the robot's description and store it for pages. `failed` is called if this is impossible."""
        self._records.keep_description(taken, failed)

    def restarting(self, now_s: float) -> None:
        """Note that the robot's ROS, and maybe the robot, was restarted, before its first messages come."""
        self.tasks.navigation.map_doubted(now_s, restarted=True)

    def restarted(self, now_s: float) -> None:
        """Note that the robot's topics can be heard again after a restart."""
        self.reports.diagnostics.restarted(now_s)
        self.tasks.refresh()

    def _report_changes(self) -> None:
        if self.lease.current:
            self._on_news()

    # --- state for links and the state file -------------------------------------------------------

    def saved_state(self) -> SavedState:
        """Return the state that must survive a kill of this process."""
        stop = self.stop_state
        goal = self.tasks.navigation.may_drive_to
        return SavedState(stop.state != "clear", stop.by or "", stop.reason, self.lease.highest, goal)

    def hello(self) -> wire.BridgeHello:
        """Return the first message to a web process. It does not depend on the robot."""
        figures = wire.BridgeFigures(self.decisions.counts, self.decisions.sum_s, self._drives.interventions)
        return wire.BridgeHello(
            wire.PROTOCOL, self.config.robot_id, self.config.slug, self.lease.highest, figures
        )

    def headline(self, now_s: float) -> tuple[object, ...]:
        """Return the part of the state whose changes are reported at once."""
        grant = self.lease.current
        return (
            *self.reports.phase(now_s),
            self.reports.is_silent(now_s),
            self.stop_state,
            grant and (grant.fence, self._neutral_needed),
            *self._after_stop.headline,
            *self.tasks.headline(now_s),
            self._forgotten[0],
        )

    @property
    def _neutral_needed(self) -> wire.NeutralNeeded | None:
        return (self._asking or self._inputs.stick).neutral_needed

    def state(self, now_s: float, watchers: list[str], watchers_more: int = 0) -> wire.State:
        """Return the robot's present state."""
        grant, skew_s = self.lease.current, self.robot_clock.skew_s
        # Speed limits concern the driver only; some sensors are subscribed only while somebody drives.
        limits = self._steady_limits.of(self._gate.limits(now_s), now_s) if grant else ()
        return wire.State(
            stop=self.stop_state,
            verdict=state_view.verdict(self._steady_verdict.shown or self._verdict, limits),
            holder=grant.holder if grant else None,
            fence=grant.fence if grant else None,
            seq=self._inputs.stick.seq,
            neutral_needed=self._neutral_needed if grant else None,
            watchers=watchers,
            watchers_more=watchers_more,
            clock_skew_s=skew_s if skew_s and abs(skew_s) > CLOCK_SKEW_S else None,
            refused=dict(self.refused),
            overload=self._late.report(now_s) or self._console_late.report(now_s),
            watchdog_missing=self.watchdog_missing,
            forgotten=state_view.forgotten(*self._forgotten, now_s),
            stands=self._stands(now_s),
            moves_although_stopped=self.moves_although_stopped(now_s),
            **self.reports.state(now_s),
            **state_view.gate_state(self._gate, now_s),
            **self.tasks.state(now_s),
            **self._recorded(),
        )

    # --- rules for tasks (tasks.Rules) ------------------------------------------------------------

    def why_closed(self, now_s: float) -> Refusal | None:
        """Return why the robot takes no request from anybody: stopped, offline, or records cannot be written."""
        if self.latch.latched:
            return Refusal("stopped", "The robot is stopped: clear the stop first.", "stop")
        phase, text = self.reports.phase(now_s)
        if phase != "online":
            return Refusal("robot_offline", text, "robot")
        return self._unrecorded

    def why_not_begin(self, requester: Requester, now_s: float) -> Refusal | None:
        """Return why a requested task may not begin now: control lost, page gone, or the robot takes no request."""
        refusal = self.lease.refuse_command(requester.holder.fence, requester.link, now_s)
        if refusal is None and self._page_gone_s is not None:
            refusal = Refusal("link_lost", "The server lost its link to the robot.", "lease")
        return refusal or self.why_closed(now_s)

    def why_not_still(self, now_s: float) -> Refusal | None:
        """Return a refusal if the base moves, is commanded to move, or its motion is unknown."""
        still = self._gate.standstill(now_s)
        if self.tasks.navigation.begun:
            return self.tasks.navigation.busy()
        if self.tasks.drives_by.running_requester or self._passed != STILL or still is False:
            return Refusal("base_moving", "The robot drives: wait until it stands still.", "robot")
        if still is None:
            text = "It is unknown whether the robot stands still: its odometry is late."
            return Refusal("base_moving", text, "robot")
        return None

    def halt(self, code: str, reason: Sentence, now_s: float) -> None:
        """Send zero now, end drives by tasks, and require neutral before the robot moves again."""
        self._zero(code, reason, now_s)
        self.tasks.halted(code, reason, now_s)

    # --- inside -----------------------------------------------------------------------------------

    def _may_rest(self, still: bool | None, now_s: float) -> bool:
        """Return whether sensors may wait: nothing asks for motion, moves or is begun, and no sensor is late."""
        return (
            self.lease.current is not None
            and self.stop_state.state == "clear"
            and still is True
            and self._asking is None
            and self._passed == self.sent == STILL
            and not (self._drives.under_way or self.drives_itself or self.tasks.under_way)
            and self._gate.hears_all(now_s)
        )

    def _end_rest(self) -> None:
        """Let what waits be taken soon. The next decision is sure of it."""
        if self._rests:
            self._rests, self._lags = False, True
            self._on_wake()

    def catch_up(self) -> None:
        """Take what still waits since the rest that has just ended."""
        if self._lags:
            self._lags = False
            self._base.take_waiting()

    def _zero(self, code: str, reason: Sentence, now_s: float) -> None:
        self._stop_until_neutral(code, reason)
        self._asking, self._passed = None, STILL
        self._publish_until_s = now_s + QUIET_AFTER_S
        self._send(STILL, now_s)
        self._end_rest()

    def _decide(self, now_s: float) -> Refusal | None:
        """Publish the present twist. Return the refusal of an input that asks for motion, if any."""
        # After a stall, odometry waits beside the command, and would seem silent. Else it waits for its turn: the
        # obstacles that are prepared for this decision would be made again.
        if self._gate.odometry_is_stale(now_s):
            self._base.take_odometry()
        self.catch_up()
        grant = self.lease.current
        if self._asking and self._asking.current(now_s) is None:
            self._silent = self._asking, now_s
            self._stop_until_neutral(*self._explain_silence(self._asking, now_s))
        awaited = self._awaited(now_s)
        self._asking, asked = self._inputs.wanted(grant, awaited is None, now_s) if grant else (None, STILL)
        drives_by, refusal = self.tasks.drives_by, None
        if grant and self._asking:
            self.tasks.superseded(now_s)
            refusal = self._why_not(grant, self._asking, now_s)
        elif grant and (requester := drives_by.running_requester):
            refusal, asked = self._drive_by(grant, requester, awaited, now_s)
        elif grant and (requester := self.tasks.navigation.driving_requester):
            self._check_navigation(grant, requester, now_s)
        self._passed = asked if refusal is None else STILL
        if asked != STILL:
            self._end_rest()  # only now: meanwhile the begin of the drive is recorded
        if self._passed != STILL:
            self.catch_up()  # it is recorded already
        verdict = self._gate.decide(self._passed, self.sent, now_s)
        if self._passed != STILL:
            self._drives.decided(verdict, now_s)
            if verdict.neutral:
                self._stop_until_neutral(verdict.code, verdict.text)
            if self._asking is None:
                drives_by.decided(verdict, now_s)
        if self._asking and refusal and refusal.code in self._halting:
            self._stop_until_neutral(refusal.code, self._halting[refusal.code])
        if self._asking and awaited:
            self._stop_until_neutral(awaited.code, awaited.sentence)
        if reason := refusal or self._unrecorded:
            verdict = verdict._replace(asked=asked, code=reason.code, text=reason.sentence)
        if self.tasks.navigation.holds_for_sensor:
            verdict = self._verdict  # it gives the reason why the base is held
        if not self.latch.latched:
            self._tell(verdict, now_s)
        if (
            self._passed == STILL
            and self.tasks.navigation.driving_requester
            and not self.tasks.navigation.holds_for_sensor
        ):
            self._drives.decided(verdict, now_s)  # an intervention may end
            self.sent = STILL  # send nothing: zeros on the drive topic have priority over navigation
        else:
            self._send(verdict.velocity if self._passed != STILL else STILL, now_s)
        return None if refusal is WAITING or self._asking is None else refusal

    def _drive_by(
        self, grant: Grant, requester: Requester, awaited: wire.NeutralNeeded | None, now_s: float
    ) -> tuple[Refusal | None, Velocity]:
        """Return the next velocity towards the goal of a task, or the rule that forbids it."""
        drives_by = self.tasks.drives_by
        refusal = self.why_not_begin(requester, now_s) or self._why_not(grant, None, now_s)
        if refusal is not None and refusal is not WAITING:
            drives_by.forbidden(refusal, now_s)
            return refusal, STILL
        if awaited:
            self._drives.halted(awaited.sentence)
            drives_by.awaits(awaited, now_s)
        return refusal, drives_by.velocity(grant, self.lease.confirmed_s, self.sent, now_s)

    def _check_navigation(self, grant: Grant, requester: Requester, now_s: float) -> None:
        """End the drive to a place if a rule forbids it. Brake if a sensor is silent.

        Otherwise continue, and record the path.
        """
        navigation = self.tasks.navigation
        if refusal := self.why_not_begin(requester, now_s) or self.tasks.blocks(Activity.NAVIGATE, now_s):
            navigation.end(
                "control_lost" if refusal.rule == "lease" else refusal.code,
                refusal.sentence,
                now_s,
                refusal.code,
            )
            return
        if not self._miss_sensors(now_s):
            navigation.note_no_fault(now_s)
        if navigation.driving_requester:
            navigation.end_if_unconfirmed(self.lease.confirmed_s, now_s)
            self._drives.may_move(holder_of(grant), now_s)

    def _miss_sensors(self, now_s: float) -> bool:
        """Brake a robot that drives itself while a sensor is silent; return whether one is."""
        fault = self._gate.fault(now_s)
        if fault is not None:
            text = say("stopped: {why}", why=fault.text)
            if overload := self._late.report(now_s):
                text = joined("; ", [text, say(BRIDGE_LATE, seconds=overload.late_s)])
            self._brake_navigation(Verdict(STILL, self._gate.velocity, fault.code, text, fault.sensor), now_s)
        return fault is not None

    def _judge_navigation(self, now_s: float) -> None:
        """Check the velocity at which navigation drives the robot. Brake if it breaks a rule of the gate."""
        verdict = self.tasks.navigation.judge(now_s)
        if verdict.code != "free":
            self._brake_navigation(verdict, now_s)

    def _brake_navigation(self, verdict: Verdict, now_s: float) -> None:
        """Brake a robot that drives itself. Its drive ends, unless the cause may soon end by itself."""
        self._tell(verdict, now_s)
        if not self.tasks.navigation.hold_for_sensor(verdict, now_s):
            self.tasks.held_back(verdict.code, verdict.text, now_s)
            verdict = verdict._replace(neutral=True)  # so that it gets its own record
        self._send(STILL, now_s)
        self._drives.decided(verdict, now_s)

    def _explain_silence(self, stick: DriveInput, now_s: float) -> tuple[str, str]:
        """Return code and reason for the expired commands of `stick`: this computer was late, or the sender was silent.

        This computer is named only if its lateness explains the gap.
        """
        for late, key in ((self._late, BRIDGE_LATE), (self._console_late, CONSOLE_LATE)):
            late_s = late.since(now_s - READ_WITHIN_S)  # earlier messages have been read
            if late_s and now_s - stick.taken_s - late_s < COMMAND_LIFE_S:
                return "overloaded", say(key, seconds=late_s)
        return "dead_man", say("no command came for {seconds} s", seconds=COMMAND_LIFE_S)

    def _tell(self, verdict: Verdict, now_s: float) -> None:
        """Take the newest verdict for pages."""
        self._verdict = verdict
        self._steady_verdict.observe(verdict, now_s)

    def _note_forgotten(self, now_s: float) -> None:
        """Note when the gate dropped its memory, so that pages can say so."""
        latest = self._gate.forgotten or BRIDGE_STARTED
        before, noticed_s = self._forgotten
        if noticed_s is None or latest != before:
            self._forgotten = latest, now_s
            log.info("%s", forgotten(latest.code))

    def _watch_records(self, now_s: float) -> None:
        """Stop motion and tasks while records cannot be written; no task may begin late."""
        why = self._records.overdue(now_s)
        if why is None:
            self._unrecorded = None
        elif self._unrecorded is None:
            self._unrecorded = unrecorded(why, self.tasks.under_way)
            self.tasks.unrecorded(self._unrecorded, now_s)

    def _awaited(self, now_s: float) -> wire.NeutralNeeded | None:
        """Return what is missing: the robot, or a sensor. Until it is back, neutral does not count.

        Otherwise, if the stick is pushed while a sensor is silent, the robot would move by itself when the
        sensor is back.
        """
        if self.reports.phase(now_s)[0] != "online":
            return wire.NeutralNeeded("robot_offline", say("the robot was offline"))
        fault = self._gate.fault(now_s)
        return wire.NeutralNeeded(fault.code, say("stopped: {why}", why=fault.text)) if fault else None

    def _why_not(self, grant: Grant, stick: DriveInput | None, now_s: float) -> Refusal | None:
        """Return the first rule that forbids motion, by a stick or by a task. Lease and age are checked elsewhere."""
        if closed := self.why_closed(now_s):
            return closed
        if refusal := self.tasks.blocks(Activity.DRIVE, now_s) or self._drives.why_not:
            return refusal
        return (stick and self._inputs.neutral_refusal(stick)) or self._drives.may_move(
            holder_of(grant), now_s
        )

    def _send(self, velocity: Velocity, now_s: float) -> None:
        """Publish during control, a stop or a hold, and shortly after. Then other nodes may use the topic."""
        if self.lease.current or self.latch.latched or self.tasks.navigation.hold.holds:
            self._publish_until_s = now_s + QUIET_AFTER_S
        if now_s < self._publish_until_s:
            self._base.publish(velocity)
        self.sent = velocity

    def _stop_until_neutral(self, code: str, reason: str) -> None:
        """Require neutral before the robot moves again: it was stopped by a cause other than the operator."""
        self._drives.halted(reason)
        self._inputs.require_neutral(code, reason)

    def _expire(self, now_s: float) -> None:
        """End an expired grant. Call this at each tick, and before waiting work may begin."""
        if self.lease.expired(now_s):
            self._end_control(say("Control was not renewed in time."), now_s)

    def _end_control(self, reason: Sentence, now_s: float) -> None:
        ended = self.lease.end_grant()
        if ended is None:
            return
        try:
            self._zero("control_ended", reason, now_s)
        finally:  # also if this zero fails: without a grant, nothing else ends them
            self.tasks.control_ended(reason, now_s)
            self._announce(Ended(ended.fence))

    def _watch_stopped(self, now_s: float) -> None:
        """Notice a robot that moves although it is stopped."""
        stands, odometry = self._stands(now_s), self.reports.odometry
        _, pose, velocity = odometry if odometry and stands is not None else (None, None, None)
        latency_s = self._gate.latency.in_force_s(now_s)
        place = None if pose is None else (self._gate.restarts, pose)
        self._after_stop.tick(
            self.stop_state, stands, place, velocity, latency_s, self.reports.ros.velocities, now_s
        )

    def _stands(self, now_s: float) -> bool | None:
        """Return whether the robot stands by its last odometry; None if that is too old."""
        odometry = self.reports.recent_odometry(now_s)
        return None if odometry is None else self._gate.standstill(odometry[0])
