"""The fleet supervisor: a bridge and a watchdog for each enabled robot, one records and one housekeeping process.

If there is an object store, one store process, too.

The fleet supervisor applies a new, edited or disabled robot within a second; other robots are not affected. After
SIGTERM, SIGINT or SIGHUP all bridges end, and their robots stop.
"""

from __future__ import annotations

import errno
import logging
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit
from uuid import UUID, uuid5

import msgspec
from django.conf import settings
from django.db import DatabaseError, connection

from fleet.audit.errors import AuditUnavailable
from fleet.base.version import release
from robots.records.faults import record_bridge
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import BridgeStatus, Robot
from robots.registry.selectors import bridge_config, require_link_settings, socket_path
from robots.registry.services import bridge_status_set
from robots.registry.stored_robots import StoredRobots
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.watchdog_config import watchdog_config
from robots.shared.processes import last_words
from robots.shared.processes.one_supervisor import LOCK, AlreadySupervised, beat
from robots.shared.processes.restarts import RestartBudget
from robots.shared.processes.shutdown import exit_within
from robots.shared.sentences import Sentence, reason_of, say
from robots.supervisor.claims import CONSOLE, Claims
from robots.supervisor.process_keeper import (
    KILL_S,
    NEXT_START,
    Keeper,
    Program,
)
from robots.supervisor.ros_environment import ONE_ARENA, ros_environment
from robots.supervisor.unready import Unready

State = BridgeStatus.State
Report = tuple[State, str, int | None]  # state, detail in words, process id
log = logging.getLogger(__name__)

STEP_S = 0.1
BEAT_S = 1.0  # much less than `FROZEN_S`
POLL_S = 0.5
DATABASE_PATIENCE_S = 0.2
END_S = KILL_S + 1.0
LAST_S = END_S + 1.0  # then this process exits, even if the database hangs
HOUSEKEEPING, RECORDS, STORE = "run_housekeeping", "run_records", "run_store"
BRIDGE, WATCHDOG = ("-m", "fleet.site.run_bridge"), ("-m", "robots.bridge.watchdog")


def eager() -> RestartBudget:
    """Return the budget of a watchdog and of the records process: quick restarts.

    Without the watchdog a stop depends on the bridge only; without records no robot may move. If one cannot start, the
    pauses get longer: each start takes 0.5 s of a processor that the bridges need.
    """
    return RestartBudget(first_s=0.1, longest_s=1.0, rest_s=10.0)


def supervise(fleet: Fleet, stopping: Stopping) -> None:
    """Run rounds until `stopping`, then end all programs."""
    beat_at_s = 0.0
    try:
        while not stopping:
            now_s = time.monotonic()
            fleet.step(now_s)
            if now_s >= beat_at_s:
                beat(settings.FLEET_RUN_DIR / LOCK)
                beat_at_s = now_s + BEAT_S
            time.sleep(STEP_S)
    finally:
        exit_within(LAST_S)
        fleet.end_programs()


def wait_shortly() -> None:
    """Wait only briefly for a locked SQLite file: bridges come first, and failed writes of states are repeated."""
    if connection.vendor == "sqlite":
        connection.close()
        connection.settings_dict["OPTIONS"]["timeout"] = DATABASE_PATIENCE_S


class Stopping:
    """True after a signal to end this process."""

    def __init__(self) -> None:
        self._asked = False
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._ask)

    def _ask(self, _number: int, _frame: object) -> None:
        self._asked = True

    def __bool__(self) -> bool:
        return self._asked


class Fleet:
    """The robots of this supervisor, each with the keepers of its bridge and of its watchdog."""

    def __init__(
        self,
        only: frozenset[str],
        manage: Path | None = None,
        watchdog: Sequence[str] = WATCHDOG,
        bridge: Sequence[str] = BRIDGE,
        *,
        host: str = "",
    ) -> None:
        self._only = only
        self._keeps_house = not (only or host)  # else another supervisor does, and has the other robots
        # Hosts in the bridge addresses of its robots; "": a robot without a bridge address
        self._hosts = {host.lower()} if host else {"", settings.FLEET_BRIDGE_HOST}
        self._role = [] if only else [uuid5(CONSOLE, host.lower()) if host else CONSOLE]  # claimed, too
        self._claims = Claims()
        self._left: dict[UUID, str] = {}  # robots that another supervisor has claimed
        self._manage = manage or settings.BASE_DIR / "manage.py"
        self._watchdog, self._bridge = watchdog, bridge
        self._keepers: dict[UUID, Keeper] = {}
        self._watchdogs: dict[UUID, Keeper] = {}
        self._stored = StoredRobots()
        self._settled: set[UUID] = set()  # robots whose entry, as stored now, is applied
        self._reported: dict[UUID, Report] = {}
        self._unsaved: dict[UUID, Report] = {}
        self._database_well = True
        self._poll_at_s = 0.0
        self._records = Keeper("Records", lambda *_: None, eager)
        self._records.want(self._program(RECORDS))
        self._housekeeping = Keeper("Housekeeping", lambda *_: None)
        if self._keeps_house:
            self._housekeeping.want(self._program(HOUSEKEEPING))
        self._store = Keeper("Store", lambda *_: None)
        if settings.FLEET_S3 is not None:
            self._store.want(self._program(STORE))

    def claim(self) -> None:
        """Claim the console, the host, or the robots of the command line. Raises `AlreadySupervised`."""
        named = Robot.objects.filter(slug__in=self._only).values_list("id", flat=True)
        for holder in self._claims.take(self._role or list(named)).values():
            raise AlreadySupervised(holder)

    def step(self, now_s: float) -> None:
        """Run one round; the next round repeats writes that the database refused."""
        if now_s >= self._poll_at_s:
            self._poll_at_s = now_s + POLL_S
            self._poll()
        for keeper in self._all:
            keeper.step(now_s)
        self._save()

    def end_programs(self) -> None:
        """End all programs and wait for them; the records process after the bridges, because they record their ends."""
        for keeper in self._all:
            if keeper is not self._records:
                keeper.want(None)
        last_s = time.monotonic() + END_S
        while time.monotonic() < last_s and not all(keeper.idle for keeper in self._all):
            if all(keeper.idle for keeper in self._keepers.values()):
                self._records.want(None)
            for keeper in self._all:
                keeper.step(time.monotonic())
            time.sleep(STEP_S)
        for robot_id, (state, _, _) in list(self._reported.items()):
            if state != State.DISABLED:
                self._report(robot_id, State.STOPPED, "", None)
        self._save()

    # --- the registry ------------------------------------------------------------------------------

    def _poll(self) -> None:
        try:
            if self._stored.read():
                self._settled.clear()
            mine = [robot for robot in self._stored.robots if self._is_mine(robot)]
            taken = self._take([robot.id for robot in mine])
            for robot in mine:
                if robot.id in taken:
                    self._leave(robot, taken[robot.id])
                else:
                    self._left.pop(robot.id, None)
                    self._update(robot)
        except DatabaseError as error:
            self._database_failed(error)
            return
        self._database_well = True
        for robot_id in self._keepers.keys() - {robot.id for robot in mine}:
            self._end_robot(robot_id)

    def _take(self, mine: list[UUID]) -> dict[UUID, str]:
        """Claim these robots; return those that another supervisor has. Give back robots that have ended here."""
        taken = self._claims.take([*self._role, *mine])
        for role in self._role:
            if role in taken:
                raise AlreadySupervised(taken[role])
        running = [robot_id for robot_id in self._keepers if not self._is_idle(robot_id)]
        self._claims.keep([*self._role, *mine, *running])
        return taken

    def _leave(self, robot: Robot, holder: str) -> None:
        """Leave the robot, and the report about it, to another supervisor."""
        if self._left.get(robot.id) == holder:
            return
        self._left[robot.id] = holder
        why = say("the supervisor on {computer} runs this robot; end one of the two", computer=holder)
        log.error("%s: %s", robot.slug, why)
        if robot.id in self._keepers:
            self._end_robot(robot.id)
        self._settled.discard(robot.id)
        self._reported.pop(robot.id, None)
        self._unsaved.pop(robot.id, None)
        last_words.write(socket_path(robot.id), last_words.WHY, why)

    def _is_mine(self, robot: Robot) -> bool:
        """Return whether the command line names the robot or its bridge's host.

        Without names: whether its bridge has no address, or one of the console's computer.
        """
        if self._only:
            return robot.slug in self._only
        return (urlsplit(robot.bridge_address).hostname or "") in self._hosts

    def _update(self, robot: Robot) -> None:
        """Apply the robot's entry, unless that is done; it reads the allow-list from the database."""
        if robot.id in self._settled:
            return
        keeper = self._keepers.get(robot.id) or self._keeper(robot)
        if not robot.enabled:
            self._end_robot(robot.id)
            self._report(robot.id, State.DISABLED, "", None)
            self._settled.add(robot.id)
            return
        try:
            require_link_settings(robot)
            config = bridge_config(robot)
            if config.digest() == keeper.digest:
                self._settled.add(robot.id)
                return
            environment = ros_environment(config, settings.FLEET_RUN_DIR)
        except (Problems, Unready) as error:
            self._end_robot(robot.id)
            self._report(robot.id, State.REFUSED, reason_of(error), None)
            return
        except OSError as error:  # a full disk; a running bridge continues with its old configuration
            state, _, pid = self._reported.get(robot.id, (State.BACKING_OFF, "", None))
            text = say(
                "The robot's new entry cannot be applied ({error}); the supervisor tries again.",
                error=error.strerror,
            )
            self._report(robot.id, state, text, pid)
            return
        path = os.pathsep.join(filter(None, [str(settings.BASE_DIR), environment.get("PYTHONPATH")]))
        as_json = "1" if settings.FLEET_LOG_JSON else ""
        environment |= {"PYTHONPATH": path, "FLEET_RELEASE": release(), "FLEET_LOG_JSON": as_json}
        arguments = [sys.executable, *self._bridge, robot.slug]
        keeper.want(Program(arguments, environment, config.digest(), partial(_for_a_start, config)))
        watched = watchdog_config(config)
        watchdog = self._watchdogs[robot.id]
        if watched.digest() != watchdog.digest:
            arguments = [sys.executable, *self._watchdog, msgspec.json.encode(watched).decode()]
            watchdog.want(Program(arguments, environment, watched.digest()))
        self._settled.add(robot.id)

    def _end_robot(self, robot_id: UUID) -> None:
        """Run neither bridge nor watchdog from now on."""
        self._settled.discard(robot_id)
        self._keepers[robot_id].want(None)
        self._watchdogs[robot_id].want(None)

    def _is_idle(self, robot_id: UUID) -> bool:
        return self._keepers[robot_id].idle and self._watchdogs[robot_id].idle

    @property
    def _all(self) -> list[Keeper]:
        return [
            self._records,
            *self._keepers.values(),
            *self._watchdogs.values(),
            self._housekeeping,
            self._store,
        ]

    def _keeper(self, robot: Robot) -> Keeper:
        robot_id = robot.id
        keeper = Keeper(
            f"Bridge of {robot.slug}",
            lambda state, detail, pid: self._report(robot_id, state, detail, pid),
            last_words=lambda: last_words.pop(socket_path(robot_id), last_words.LAST),
        )
        self._keepers[robot_id] = keeper
        self._watchdogs[robot_id] = Keeper(f"Watchdog of {robot.slug}", lambda *_: None, eager)
        return keeper

    def _program(self, command: str) -> Program:
        return Program([sys.executable, str(self._manage), command], {**os.environ, **ONE_ARENA}, command)

    def _database_failed(self, error: DatabaseError | AuditUnavailable) -> None:
        """Log the error, only once until the database answers again. All programs keep running."""
        if self._database_well:
            log.warning("The database cannot be used, the fleet stays as it is: %s", error)
        self._database_well = False
        connection.close()

    # --- status for pages --------------------------------------------------------------------------

    def _report(self, robot_id: UUID, state: State, detail: str, pid: int | None) -> None:
        report = (state, detail, pid)
        if robot_id in self._left:
            return
        if self._reported.get(robot_id) != report:
            self._reported[robot_id] = self._unsaved[robot_id] = report
            _tell_why(robot_id, state, detail)

    def _save(self) -> None:
        for robot_id, (state, detail, pid) in list(self._unsaved.items()):
            try:
                bridge_status_set(robot_id=robot_id, state=state, detail=detail, pid=pid)
                record_bridge(robot_id, state, detail)
            except (DatabaseError, AuditUnavailable) as error:
                self._database_failed(error)
                return
            del self._unsaved[robot_id]


def _for_a_start(config: BridgeConfig) -> Mapping[str, str]:
    """Return a bridge's configuration with the newest fence, as a variable: other accounts can read arguments."""
    try:
        fence = Robot.objects.values_list("fence", flat=True).get(pk=config.robot_id)
    except (DatabaseError, Robot.DoesNotExist) as error:
        raise OSError(errno.EAGAIN, "the database does not tell its fence") from error
    fresh = msgspec.structs.replace(config, last_fence=fence)
    return {"FLEET_BRIDGE": msgspec.json.encode(fresh).decode()}


def _tell_why(robot_id: UUID, state: State, detail: str) -> None:
    """Tell web processes why a bridge is not running. While it starts, the last reason stays."""
    why = detail.figures["why"] if isinstance(detail, Sentence) and detail.key == NEXT_START else detail
    if why and state in (State.BACKING_OFF, State.REFUSED):
        last_words.write(socket_path(robot_id), last_words.WHY, why)
    elif state != State.STARTING:
        last_words.clear(socket_path(robot_id), last_words.WHY)
