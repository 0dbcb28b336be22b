"""Events that the black box keeps: each event once, and nothing that was so before control began."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from robots.bridge.drive.drive_log import Held
from robots.bridge.recorder.black_box.contacts import Contacts, reports_contact
from robots.bridge.recorder.black_box.events import Events
from robots.bridge.recorder.black_box.ring import Message, Origin
from robots.shared import wire
from robots.shared.messages.serialization import CDR
from tests.bridge.support import Bench


class Watch:
    """Events as they are noticed."""

    def __init__(self) -> None:
        self.seen: list[str] = []
        self.events = Events(lambda event, text, by: self.seen.append(f"{event} {text}"))
        bench = Bench().online()
        self.state = structs.replace(bench.core.state(bench.now_s, []), fence=1, phase="online", sensors=[])
        self.now_s = 0.0
        self.see()  # the beginning
        self.see()

    def see(self, held: Held | None = None, after_s: float = 1.0, **changes: Any) -> list[str]:
        """Observe the state with these changes; return the new events."""
        self.state = structs.replace(self.state, **changes)
        self.now_s += after_s
        before = len(self.seen)
        self.events.observe(self.state, held, self.now_s)
        return self.seen[before:]


@pytest.fixture
def watch() -> Watch:
    return Watch()


def sensor(ok: bool) -> list[wire.Sensor]:
    return [wire.Sensor("laser", "scan", ok, 0.1, "" if ok else "it is silent")]


def health(name: str, level: wire.HealthLevel) -> wire.Health:
    return wire.Health(level, [wire.HealthPart(name, level, "it broke", 1)], 0, 3, [])


def test_each_press_of_stop_is_an_event(watch) -> None:
    number = watch.state.stop.number
    stop = wire.StopState("stopping", "Bob", number=number + 1)
    assert watch.see(stop=stop) == ["stop Stopped by Bob."]
    assert watch.see(stop=structs.replace(stop, state="stopped")) == []
    assert watch.see(stop=structs.replace(stop, number=number + 2)) == ["stop Stopped by Bob."]
    assert watch.see(stop=wire.StopState("clear", number=number + 2)) == []


def test_the_gate_counts_after_a_second_and_once(watch) -> None:
    assert watch.see(Held(1, 0.9, "wall ahead")) == []
    assert watch.see(Held(1, 1.1, "wall ahead")) == ["gate wall ahead"]
    assert watch.see(Held(1, 9.0, "wall ahead")) == []
    assert watch.see(Held(2, 1.5, "door")) == ["gate door"]


def test_faults_that_last_are_events(watch) -> None:
    assert watch.see(sensors=sensor(True)) == []
    assert watch.see(sensors=sensor(False)) == []
    assert watch.see(sensors=sensor(True), after_s=0.5) == []  # a hiccup
    assert watch.see(sensors=sensor(False)) == []
    assert watch.see() == ["fault laser: it is silent"]
    assert watch.see() == []
    watch.see(sensors=sensor(True))
    assert watch.see(sensors=sensor(False)) + watch.see() == []  # the same fault again
    watch.see(sensors=sensor(True), after_s=40.0)
    assert watch.see(sensors=sensor(False)) + watch.see() == ["fault laser: it is silent"]
    assert watch.see(phase="waiting", text="No master.") + watch.see() == ["fault No master."]


def test_a_part_that_reports_an_error_or_a_touch_is_an_event(watch) -> None:
    assert watch.see(health=health("arm", "warning")) == []
    assert watch.see(health=health("arm", "error")) == ["fault arm: it broke"]
    assert watch.see() == []
    assert watch.see(health=health("bumper_left", "warning")) == ["contact bumper_left: it broke"]


def test_what_is_so_at_the_beginning_is_no_event(watch) -> None:
    watch.see(fence=None)
    ill = {"sensors": sensor(False), "health": health("arm", "error")}
    assert watch.see(Held(7, 5.0, "wall"), fence=2, **ill) == []
    assert watch.see(Held(7, 6.0, "wall")) + watch.see() == []
    assert watch.see(fence=None, sensors=sensor(True)) == []


@pytest.mark.parametrize(
    ("topic", "type_", "touched", "free"),
    [
        ("/mobile_base/events/bumper", "kobuki_msgs/BumperEvent", b"\x01\x01", b"\x01\x00"),
        ("/contact_front", "std_msgs/Bool", b"\x01", b"\x00"),
        ("/gazebo/contacts", "gazebo_msgs/ContactsState", bytes(16) + b"\x02\0\0\0", bytes(20)),
        ("/bumper", "create_msgs/Bumper", bytes(16) + b"\0\x01", bytes(18)),
        ("/bumper", "kobuki_msgs/msg/BumperEvent", CDR.head + b"\x01\x01", CDR.head + b"\x01\x00"),
        ("/contact_front", "std_msgs/msg/Bool", CDR.head + b"\x01", CDR.head + b"\x00"),
        (
            "/contacts",
            "gazebo_msgs/msg/ContactsState",
            CDR.head + bytes(8) + b"\x02\0\0\0w\0\0\0" + b"\x02\0\0\0",
            CDR.head + bytes(8) + b"\x02\0\0\0w\0\xff\xff" + bytes(4),
        ),
    ],
)
def test_a_contact_begins_once(topic: str, type_: str, touched: bytes, free: bytes) -> None:
    assert reports_contact(topic, type_) and not reports_contact("/is_charging", "std_msgs/Bool")
    contacts, second = Contacts(), 10**9
    encoding = "cdr" if "/msg/" in type_ else "ros1"
    seen = [
        contacts.begins(Message(Origin(topic, encoding, type_, "", ""), 0, at_s * second, data))
        for at_s, data in (
            (0, free),
            (1, touched),
            (2, touched),
            (3, free),
            (4, touched),
            (20, touched),
            (21, b""),
        )
    ]
    assert seen == [False, True, False, False, False, True, False]
