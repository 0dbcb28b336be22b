"""Real bridge and watchdog processes, and a client of the bridge's link."""

from __future__ import annotations

import shutil
import socket
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

import msgspec
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import unix_connect

from robots.shared import wire
from robots.shared.configuration.bridge_config import (
    BridgeConfig,
    LinkAddress,
    ScanSource,
    SonarSource,
    Topic,
    Topics,
)
from robots.shared.configuration.gate_profile import GateProfile, Limits
from robots.shared.configuration.robot_ros import Ros, Ros1
from robots.shared.configuration.watchdog_config import lane_path, watchdog_config
from tests.forked import ForkedProgram
from tests.processes import PATIENCE_S, end, until
from tests.ros.support import Master

SONARS = {
    "base_sonar_01_link": (-0.183, -0.183, -2.356),
    "base_sonar_02_link": (-0.259, 0.0, 3.1416),
    "base_sonar_03_link": (-0.183, 0.183, 2.356),
}


class Host(Protocol):
    """Where a robot's processes find each other: a rosmaster, or a domain."""

    def fork(self, program: str, *arguments: str, log: Path) -> ForkedProgram: ...


def tiago_config(master: Master, folder: Path, **changes: Any) -> BridgeConfig:
    """A TIAGo's configuration as the registry writes it, with changes: ``name="Ann"``, ``gate={"has_arm": True}``."""
    return robot_config(folder, **{"ros": Ros1(master.uri, "127.0.0.1")} | changes)


def robot_config(folder: Path, ros: Ros, **changes: Any) -> BridgeConfig:
    """The same for a robot with any ROS. Its topics are those of ROS 1.

    The socket is in a folder with a short name, because the length of a socket's path is limited.
    """
    robot_id = uuid.uuid4().hex
    sockets = Path(tempfile.gettempdir()) / f"fleet-test-{robot_id[:8]}"
    config = BridgeConfig(
        robot_id=robot_id,
        slug="tiago-1",
        name="Tiago 1",
        ros=ros,
        topics=Topics(
            drive=Topic("/key_vel", "geometry_msgs/Twist"),
            odometry=Topic("/mobile_base_controller/odom", "nav_msgs/Odometry"),
            scans=[ScanSource("/scan_raw", (0.202, 0.0, 0.0))],
            sonars=[SonarSource("/sonar_base", name, pose, 0.5, 1.0) for name, pose in SONARS.items()],
            battery=Topic("/power/battery_level", "std_msgs/Float32"),
            cancel_on_stop=["/tts", "/play_motion"],
        ),
        gate=GateProfile(
            limits=Limits(1.0, 0.2, 0.0, 2.0944, 1.0, 2.0944),
            radius_m=0.27,
            outline=None,
            scan_poses={"/scan_raw": (0.202, 0.0, 0.0)},
            sonar_poses=dict(SONARS),
            sonar_fov=dict.fromkeys(SONARS, 0.5),
            has_depth=True,
            blind_mps=0.3,
        ),
        reverse_steering="turn",
        link=LinkAddress(unix_path=str(sockets / "b.sock")),
        state_dir=str(folder / robot_id),
    )
    for part in ("topics", "gate"):
        if isinstance(changes.get(part), dict):
            changes[part] = msgspec.structs.replace(getattr(config, part), **changes[part])
    return msgspec.structs.replace(config, **changes)


def drivable(state: wire.State) -> bool:
    """True if the robot is online and all sensors have sent data. Before this, the gate asks for a neutral stick."""
    return state.phase == "online" and all(sensor.ok for sensor in state.sensors if sensor.kind != "depth")


@contextmanager
def renewing(renew: Callable[[], None], every_s: float = 0.2) -> Iterator[None]:
    """Renew control from a thread, because answers and states come late on a busy computer."""
    over = threading.Event()

    def go_on() -> None:
        while not over.wait(every_s):
            renew()

    thread = threading.Thread(target=go_on, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


class RobotProcess:
    """One of a robot's processes. It ends when its standard input closes: the supervisor has died."""

    def __init__(self, master: Host, log: Path, module: str, *arguments: str) -> None:
        self.log = log
        self.process = master.fork(module, *arguments, log=log)

    def cut_life_line(self) -> int:
        """Close the process's standard input, as if the supervisor died; return the exit code."""
        self.process.stdin.close()
        return self.process.wait(PATIENCE_S)

    def kill(self) -> None:
        """Kill the process with SIGKILL, as in a crash."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        end(self.process)
        self.process.stdin.close()


class BridgeProcess(RobotProcess):
    """One bridge."""

    def __init__(self, config: BridgeConfig, master: Host, folder: Path) -> None:
        self.config = config
        self.records = folder / f"{config.robot_id}.records"
        config_file = folder / f"{config.robot_id}.config"
        config_file.write_bytes(msgspec.json.encode(config))
        log = folder / f"{config.robot_id}.log"
        super().__init__(master, log, "tests.ros.bridge_process", str(config_file), str(self.records))

    def link(self) -> Hand:
        """Wait until the bridge listens, and open a link."""
        path = self.config.link.unix_path
        assert path is not None
        until(lambda: listens(path) or self.process.poll() is not None, f"a listener on {path}")
        return Hand(path)

    def recorded(self) -> list[str]:
        """Return the lines that the bridge has recorded so far."""
        return self.records.read_text().splitlines()

    def description(self) -> str:
        """Return the problem of the robot's description, or "read"; "" if there is no result yet."""
        found = self.records.with_suffix(".description")
        return found.read_text() if found.exists() else ""

    def stop(self) -> None:
        super().stop()
        assert self.config.link.unix_path is not None
        shutil.rmtree(Path(self.config.link.unix_path).parent, ignore_errors=True)


@contextmanager
def running_bridge(config: BridgeConfig, master: Host, folder: Path) -> Iterator[tuple[BridgeProcess, Hand]]:
    """A bridge and one link to it, for the length of a `with` block."""
    process = BridgeProcess(config, master, folder)
    try:
        with closing(process.link()) as hand:
            yield process, hand
    finally:
        process.stop()


class WatchdogProcess(RobotProcess):
    """The watchdog of a bridge's robot."""

    def __init__(self, config: BridgeConfig, master: Host, folder: Path) -> None:
        self.config = config
        encoded = msgspec.json.encode(watchdog_config(config)).decode()
        super().__init__(
            master, folder / f"{config.robot_id}.watchdog.log", "robots.bridge.watchdog", encoded
        )

    def ready(self) -> WatchdogProcess:
        """Wait until the watchdog has joined the master."""
        until(lambda: "joined" in self.log.read_text() or self.process.poll() is not None, "the watchdog")
        return self

    def press(
        self,
        by: str = "Ann",
        reason: str = "",
        robot: uuid.UUID | None = None,
        press: uuid.UUID | None = None,
    ) -> wire.LinkReport:
        """Stop the robot like a web process that cannot reach the bridge; return the answer."""
        return self.say(wire.encode(wire.LinkStop(by, reason, 7, robot, press)))

    def say(self, message: bytes) -> wire.LinkReport:
        """Send a message on the watchdog's socket; return the answer."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane:
            lane.settimeout(PATIENCE_S)
            lane.connect(lane_path(self.config))
            lane.send(message)
            return wire.link_report(lane.recv(65536))


@contextmanager
def guarded_bridge(config: BridgeConfig, host: Host, folder: Path) -> Iterator[tuple[BridgeProcess, Hand]]:
    """A bridge, one link to it, and its watchdog. Without the watchdog no robot drives to a place."""
    watchdog = WatchdogProcess(config, host, folder)
    try:
        watchdog.ready()
        with running_bridge(config, host, folder) as (process, hand):
            yield process, hand
    finally:
        watchdog.stop()


def _fence_of(report: Any) -> int | None:
    """Return the fence of a state report, 0 without control; None if the report is no state."""
    return report.state.fence or 0 if isinstance(report, wire.Status) else None


def listens(path: str) -> bool:
    """Return whether the socket accepts connections. Its file proves nothing: a killed bridge leaves the file."""
    with socket.socket(socket.AF_UNIX) as probe:
        return probe.connect_ex(path) == 0


class Hand:
    """Client of a bridge's link: sends messages, and drives at 20 Hz from a thread."""

    def __init__(self, path: str) -> None:
        self._closing = ExitStack()
        self._socket = self._closing.enter_context(unix_connect(path, compression=None))
        self._reports: list[Any] = []
        self._news = threading.Condition()
        self._stick: tuple[float, float, float] | None = None
        self._seq = 0
        self._sending = threading.Lock()  # keeps numbers in order between the test and the driving thread
        self.fence = 0
        self.state: wire.State | None = None
        self.view: Any = None  # the newest view
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=self._drive, daemon=True).start()
        self.send(wire.LinkHello(wire.PROTOCOL, "test"))

    def send(self, message: msgspec.Struct) -> None:
        self._socket.send(wire.encode(message), text=True)

    def until(self, condition: Callable[[Any], Any], what: str, timeout_s: float = PATIENCE_S) -> Any:
        """Wait for a report, old or new, for which `condition` is true; return the first one."""
        deadline = time.monotonic() + timeout_s
        with self._news:
            while True:
                for report in self._reports:
                    if condition(report):
                        return report
                remaining_s = deadline - time.monotonic()
                if remaining_s <= 0:
                    raise AssertionError(f"not within {timeout_s} s: {what}; the last state: {self.state}")
                self._reports.clear()
                self._news.wait(remaining_s)

    def ask(self, task: Any) -> wire.Refusal | None:
        """Send a task; return its refusal, None if accepted. Each task needs a new `seq`."""
        self.send(task)
        kind = wire.kind_of(task)
        answer = self.until(
            lambda r: isinstance(r, wire.Accepted | wire.Refused) and (r.seq, r.of) == (task.seq, kind),
            f"an answer to {task}",
        )
        return answer.refusal if isinstance(answer, wire.Refused) else None

    def state_until(self, condition: Callable[[wire.State], Any], what: str) -> wire.State:
        """Wait for a state for which `condition` is true; return the first one."""
        report = self.until(lambda r: isinstance(r, wire.Status) and condition(r.state), what)
        state: wire.State = report.state
        return state

    def news(self) -> wire.State:
        """Forget the reports so far, and wait for the next state."""
        with self._news:
            self._reports.clear()
        return self.state_until(lambda state: True, "a state")

    def drive_until(
        self, x: float, condition: Callable[[wire.State], Any], what: str, y: float = 0.0
    ) -> wire.State:
        """Push the stick until `condition` is true for a state; return that state.

        On a busy computer a scan can be late. The gate then asks for a neutral stick: the stick returns to the middle.
        """

        def pushed(state: wire.State) -> Any:
            share = 0.0 if state.neutral_needed else 1.0
            self.stick(share * x, y=share * y)
            return condition(state)

        return self.state_until(pushed, what)

    def take_control(self, fence: int, seconds: float = 60.0) -> None:
        self.send(wire.Grant(fence, seconds, f"session-{fence}", "Ann", "ann", 1.0))
        self.until(lambda r: isinstance(r, wire.Granted) and r.fence == fence, "a grant")
        self.state_until(lambda state: state.fence == fence, "control")
        with self._news:  # only the driver gets speed limits: drop earlier states
            self._reports = [report for report in self._reports if _fence_of(report) in (None, fence)]
        self.fence = fence
        self.stick(0.0, 0.0)

    def stick(self, x: float, w: float = 0.0, y: float = 0.0) -> None:
        """Hold the stick at this position until the next call."""
        self._stick = (x, y, w)
        self._send_stick()

    def let_go(self) -> None:
        """Send no more drive messages."""
        self._stick = None

    def close(self) -> None:
        self.let_go()
        self._closing.close()

    def _send_stick(self) -> None:
        with self._sending:
            if self._stick is None:
                return
            self._seq += 1
            x, y, w = self._stick
            sent_ms = time.monotonic() * 1000
            self.send(wire.Drive(fence=self.fence, seq=self._seq, sent_ms=sent_ms, x=x, y=y, w=w, share=1.0))

    def _drive(self) -> None:
        pace = threading.Event()
        while not pace.wait(0.05):
            try:
                self._send_stick()
            except ConnectionClosed:  # the test ended or cut the link
                return

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            while True:
                raw = self._socket.recv()
                if isinstance(raw, bytes):
                    self.view = wire.browser_report(raw)
                else:
                    report = wire.link_report(raw)
                    with self._news:
                        if isinstance(report, wire.Status):
                            self.state = report.state
                        self._reports.append(report)
                        self._news.notify_all()
