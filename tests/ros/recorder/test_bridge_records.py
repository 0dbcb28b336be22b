"""A bridge with its recorder: black box of a drive with a stop, a recording on request, and what breaks."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import UUID, uuid4

import msgspec
import psutil
import pytest
from msgspec import structs

from robots.bridge.recorder.files.finished_files import read
from robots.bridge.recorder.recorder_messages import COMMAND, EVENT, VERDICT, VIEW, ChainEvent
from robots.link.connections import LinkRefused
from robots.link.state_reader import order_once, state_once
from robots.shared import wire
from robots.shared.configuration.bridge_config import RecordingPlace
from robots.shared.records.record_sink import TakenRecording
from tests.processes import until
from tests.recorder_process import messages_of
from tests.ros.bridge_support import BridgeProcess, Hand, drivable, running_bridge, tiago_config
from tests.ros.support import SimulatorProcess


@pytest.fixture(scope="module", autouse=True)
def robot(rosmaster, simulator) -> SimulatorProcess:
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    return tmp_path / "recordings"


@pytest.fixture
def bridge(rosmaster, tmp_path, directory) -> Iterator[tuple[BridgeProcess, Hand]]:
    config = tiago_config(rosmaster, tmp_path, recordings=RecordingPlace(str(directory), 10**9, 0))
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "the robot to be online")
        hand.take_control(1)
        hand.state_until(lambda state: state.black_box and state.black_box.seconds >= 1, "the black box")
        yield process, hand


def taken_by(process: BridgeProcess) -> list[TakenRecording]:
    """Return the recordings by hand that the bridge has stored."""
    lines = [line.split(" ", 2) for line in process.recorded()]
    return [
        msgspec.json.decode(line[2], type=TakenRecording)
        for line in lines
        if line[:2] == ["recording", "by_hand"]
    ]


def recorder_of(process: BridgeProcess) -> int:
    """Return the process id of the bridge's recorder."""
    children = Path(f"/proc/{process.process.pid}/task/{process.process.pid}/children").read_text().split()
    return next(
        int(child) for child in children if b"ros.recorder" in Path(f"/proc/{child}/cmdline").read_bytes()
    )


def goes_on(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def record(hand: Hand, seq: int, **more: Any) -> wire.Refusal | None:
    order = wire.LinkRecord(more.pop("recording", uuid4()), 600.0, "all", "Ada", "person-1", seq=seq, **more)
    return hand.ask(order)


def test_a_stop_in_a_drive_is_kept_with_the_chain(bridge, directory) -> None:
    process, hand = bridge
    hand.drive_until(0.5, lambda state: state.odometry.vx > 0.1, "the robot to move")
    hand.send(wire.LinkStop("Bob", "a test", 5))
    hand.state_until(lambda state: state.black_box and state.black_box.keeps == "stop", "the event")
    hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
    process.stop()  # finishes the file before its 15 s are over
    (path,) = directory.glob("*-black_box-*.mcap")
    found = messages_of(path)
    assert {VIEW, COMMAND, VERDICT, EVENT, "/scan_raw", "/mobile_base_controller/odom"} <= found.keys()
    events = [msgspec.json.decode(data, type=ChainEvent) for _, data in found[EVENT]]
    assert [event.event for event in events][-1] == "stop"
    chain = [data for topic in (VIEW, COMMAND, VERDICT, EVENT) for _, data in found[topic]]
    assert not any(b"Bob" in data for data in chain)
    views = [msgspec.json.decode(data, type=wire.View) for _, data in found[VIEW]]
    assert any(view.state.odometry.vx > 0.1 for view in views) and views[0].scan is not None
    assert views[-1].state.stop.state != "clear"
    assert path.with_suffix(".jpg").exists() is False  # this robot has no camera
    taken = read(path)
    assert taken is not None and [control.session for control in taken.controls or ()] == [taken.session]


def test_a_recording_outlives_its_recorder(bridge, directory) -> None:
    process, hand = bridge
    first = uuid4()
    assert record(hand, 1, recording=first) is None
    refusal = record(hand, 2)
    assert refusal is not None and refusal.code == "recording_goes_on"
    hand.state_until(lambda state: state.recording and state.recording.bytes > 10_000, "bytes")
    os.kill(recorder_of(process), signal.SIGKILL)
    hand.state_until(lambda state: state.recording.refusal is not None, "the loss")
    again = hand.state_until(
        lambda state: state.recording.refusal is None and state.recording.bytes > 10_000, "a new recorder"
    ).recording
    assert again.recording != first
    assert hand.ask(wire.LinkRecordEnd(first, seq=3)) is None
    until(lambda: len(taken_by(process)) == 2, "both parts")
    parts = {taken.recording: taken for taken in taken_by(process)}
    assert parts[first].cut and parts[first].continues is None
    assert not parts[again.recording].cut and parts[again.recording].continues == first
    for taken in parts.values():
        assert "/scan_raw" in messages_of(directory / taken.name)
    until(lambda: not list(directory.glob("*.new")), "both rows")


def test_a_booking_is_recorded_over_a_link_of_its_own(bridge, directory) -> None:
    """As housekeeping does: no page is open, and the recorder has to start first."""
    process, _ = bridge
    robot, address = UUID(process.config.robot_id), process.config.link
    booking, recording = str(uuid4()), uuid4()
    order = wire.LinkRecord(recording, 4.0, "all", "Ada", "person-1", kind="booking", booking=booking)
    order_once(robot, address, order, 10.0)
    until(lambda: state_once(robot, address).recording, "the recorder's first report")
    goes_on = state_once(robot, address).recording
    assert goes_on is not None and (goes_on.recording, goes_on.kind) == (recording, "booking")
    with pytest.raises(LinkRefused, match="records this robot"):
        order_once(robot, address, structs.replace(order, recording=uuid4()), 10.0)
    until(lambda: list(directory.glob(f"*-booking-{recording}.mcap")), "its end by the bridge's clock")
    [path] = directory.glob("*-booking-*.mcap")
    taken = read(path)
    assert taken is not None and taken.booking == booking and "/scan_raw" in messages_of(path)


def test_a_hanging_recorder_delays_no_command(bridge) -> None:
    process, hand = bridge
    stopped = recorder_of(process)
    os.kill(stopped, signal.SIGSTOP)
    try:
        hand.drive_until(0.3, lambda state: state.odometry.vx > 0.1, "the robot to move")
        until(lambda: recorder_gone(process, stopped), "the end of the hanging recorder")
    finally:
        with suppress(ProcessLookupError):
            os.kill(stopped, signal.SIGCONT)


def recorder_gone(process: BridgeProcess, pid: int) -> bool:
    try:
        return recorder_of(process) != pid
    except (StopIteration, OSError):
        return True


def test_keep_this_and_its_refusal(bridge) -> None:
    _, hand = bridge
    assert hand.ask(wire.LinkKeep("Ada", "person-1", "a noise", 4)) is None
    hand.state_until(lambda state: state.black_box.keeps == "keep", "the event")


def test_a_killed_bridge_leaves_a_file_whose_row_follows(rosmaster, tmp_path, directory) -> None:
    config = tiago_config(rosmaster, tmp_path, recordings=RecordingPlace(str(directory), 10**9, 0))
    recording = uuid4()
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.state_until(drivable, "the robot to be online")
        assert record(hand, 1, recording=recording) is None
        hand.state_until(lambda state: state.recording and state.recording.bytes > 10_000, "bytes")
        recorder = psutil.Process(recorder_of(process))
        process.kill()
        until(lambda: not goes_on(recorder), "the end of its recorder, with the file if there is time")
    with running_bridge(config, rosmaster, tmp_path) as (process, hand):
        hand.take_control(1)  # the next recorder finishes a file that was cut
        until(lambda: taken_by(process), "the row")
        (taken,) = taken_by(process)
        assert taken.recording == recording and (taken.cut or taken.ended_by == "Its recorder ended.")
        until(lambda: not list(directory.glob("*.new")), "the row to be known")
