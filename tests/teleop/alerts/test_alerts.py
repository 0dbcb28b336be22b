"""Alerts: what needs somebody is stored, told by the rules, shown on the page *Status*, and told when it is over."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from django.conf import LazySettings
from django.db import OperationalError
from django.test import Client
from django.utils import timezone, translation

from fleet.accounts.models import User
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from fleet.base.database.schema import SchemaRefused
from fleet.base.formats.sentences import in_words
from robots.recordings.models import Place, Recording
from robots.registry.models import Robot
from robots.shared.processes.one_supervisor import LOCK, forget, only_instance
from robots.shared.sentences import say
from script.stack.places import REPOSITORY
from teleop.alerts import checks, telling
from teleop.alerts.checks import Trouble
from teleop.alerts.history import lines
from teleop.alerts.metrics import AlertCollector
from teleop.alerts.watch import DATABASE_S, STALE_S, AlertWatch, WithoutDatabase, knows
from teleop.models import Alert, AlertRule

NOW = datetime(2026, 11, 30, 10, 0, tzinfo=UTC)


class Watched:
    """The watch with one invented trouble, and the letters that it wrote."""

    def __init__(self, patch: pytest.MonkeyPatch, robot: Robot) -> None:
        self.there = True
        self.letters: list[Any] = []
        self._robot = robot
        self.watch = AlertWatch()
        self.watch._checks = {("bridge",): self._found}
        patch.setattr(telling.emails.transaction, "on_commit", lambda function: function())
        patch.setattr(telling.emails, "send_at_once", lambda letters: self.letters.extend(letters))
        patch.setattr(telling, "is_off", lambda: False)

    def _found(self) -> Iterator[Trouble]:
        if self.there:
            yield Trouble(
                "bridge", self._robot.slug, say("{robot} is gone", robot=self._robot.name), self._robot
            )

    def look(self, minutes: float) -> list[str]:
        """Look so many minutes after the begin; return the subjects of new letters."""
        before = len(self.letters)
        self.watch.look(NOW + timedelta(minutes=minutes))
        return [letter.subject for letter in self.letters[before:]]


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch, robot: Robot, staff: User) -> Watched:
    User.objects.filter(pk=staff.pk).update(email="sam@lab.example")
    return Watched(monkeypatch, robot)


def kinds() -> list[str]:
    return list(
        Record.objects.filter(kind__startswith="alert.").order_by("id").values_list("kind", flat=True)
    )


def test_a_trouble_is_told_once_again_after_a_day_and_when_it_is_over(watched: Watched) -> None:
    assert watched.look(0) == [] and watched.look(1.9) == []
    assert watched.look(2) == ["TIAGo 1 is gone"]
    assert watched.letters[0].to == ["sam@lab.example"]
    assert watched.look(3) == []
    assert watched.look(2 + 24 * 60) == ["Still: TIAGo 1 is gone"]
    watched.there = False
    assert watched.look(3 + 24 * 60) == ["Over: TIAGo 1 is gone"]
    assert kinds() == ["alert.begin", "alert.still", "alert.over"]
    assert watched.look(4 + 24 * 60) == []


def test_a_short_trouble_is_told_to_nobody_but_stays_in_the_history(watched: Watched, robot: Robot) -> None:
    watched.look(0)
    watched.there = False
    assert watched.look(1) == [] and kinds() == []
    assert Alert.objects.get().robot == robot


def test_a_trouble_lasts_as_long_as_it_is_found(watched: Watched) -> None:
    AlertRule.objects.create(kind="bridge", after_min=1, again_h=0)
    assert watched.look(0) == watched.look(0.5) == []
    watched.there = False
    assert watched.look(1) == watched.look(2) == [] == kinds()
    assert Alert.objects.get().over_at == NOW + timedelta(minutes=0.5)


def test_quiet_times_hold_letters_back_but_not_records(watched: Watched) -> None:
    AlertRule.objects.create(
        kind="bridge", after_min=0, again_h=0, quiet_from="22:00", quiet_until="12:00", to="a@x.org; b@x.org"
    )
    assert watched.look(0) == [] and kinds() == ["alert.begin"]
    assert watched.look(2 * 60) == ["TIAGo 1 is gone"] * 2
    assert watched.look(72 * 60) == []  # never again


def test_quiet_times_hold_back_the_letter_that_it_is_over(watched: Watched) -> None:
    AlertRule.objects.create(kind="bridge", after_min=0, again_h=0, quiet_from="12:00", quiet_until="14:00")
    assert watched.look(0) == ["TIAGo 1 is gone"]
    watched.look(119)
    watched.there = False
    assert watched.look(2 * 60 + 1) == [] and kinds() == ["alert.begin", "alert.over"]
    assert watched.look(4 * 60) == ["Over: TIAGo 1 is gone"]
    assert watched.look(4 * 60 + 1) == []


def test_a_rule_that_is_off_tells_nobody(watched: Watched) -> None:
    AlertRule.objects.create(kind="bridge", after_min=0, again_h=24, active=False)
    assert watched.look(0) == [] == kinds()


def test_two_processes_tell_it_once(watched: Watched) -> None:
    watched.look(0)
    other = AlertWatch()
    other._checks = watched.watch._checks
    watched.look(2)
    other.look(NOW + timedelta(minutes=2))
    assert len(watched.letters) == 1 and Alert.objects.count() == 1


def test_what_only_one_computer_sees_stays_while_it_sees_it(watched: Watched) -> None:
    AlertRule.objects.create(kind="bridge", after_min=0, again_h=0)
    other = AlertWatch()
    other._checks = {("bridge",): lambda: iter(())}
    for quarter in range(8):
        watched.look(quarter / 4)
        other.look(NOW + timedelta(minutes=quarter / 4))
    assert kinds() == ["alert.begin"] and len(watched.letters) == 1
    watched.there = False
    assert watched.look(2.5) == [] and watched.look(2.75) == ["Over: TIAGo 1 is gone"]


def test_a_fault_of_one_check_silences_no_other(watched: Watched) -> None:
    def broken() -> Iterator[Trouble]:
        raise RuntimeError

    watched.watch._checks = {("disk",): broken} | watched.watch._checks
    watched.look(0)
    assert watched.look(2) == ["TIAGo 1 is gone"]


def test_what_could_not_be_recorded_is_told_in_the_next_round(
    watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AuditUnavailable("audit", "away")

    watched.look(0)
    with monkeypatch.context() as patch, pytest.raises(AuditUnavailable):
        patch.setattr(telling, "record", refuse)
        watched.look(2)
    assert watched.look(2.25) == ["TIAGo 1 is gone"] and kinds() == ["alert.begin"]


def test_a_clock_that_is_set_back_silences_nothing(watched: Watched) -> None:
    watched.look(0)
    assert watched.look(-60 * 24 * 365) == ["TIAGo 1 is gone"]
    watched.there = False
    assert watched.look(-60 * 24 * 366) == ["Over: TIAGo 1 is gone"]


def test_a_letter_waits_for_a_mail_server(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    watched.look(0)
    with monkeypatch.context() as patch:
        patch.setattr(telling, "is_off", lambda: True)
        assert watched.look(2) == [] and kinds() == ["alert.begin"]
    assert watched.look(3) == ["TIAGo 1 is gone"]


def test_each_letter_is_in_its_readers_language(watched: Watched, staff: User) -> None:
    User.objects.filter(pk=staff.pk).update(language="es")
    watched.look(0)
    watched.look(2)
    watched.there = False
    assert watched.look(3) == ["Terminado: TIAGo 1 is gone"]


def test_a_database_that_is_away_is_told_by_letter_alone(watched: Watched) -> None:
    without = WithoutDatabase()
    without.know(AlertRule(kind="database", after_min=1, again_h=24))
    without.is_away(100.0, OperationalError("away"))
    assert watched.letters == []
    without.is_away(100.0 + DATABASE_S, OperationalError("away"))
    without.is_away(101.0 + DATABASE_S, OperationalError("away"))
    without.is_back()
    assert [letter.subject for letter in watched.letters] == [
        "Robots stand, because nothing can be recorded: the database does not answer.",
        "Over: Robots stand, because nothing can be recorded: the database does not answer.",
    ]


def test_a_database_of_another_release_is_not_told_to_be_away(watched: Watched) -> None:
    without = WithoutDatabase()
    without.know(AlertRule(kind="database", after_min=1, again_h=24))
    refused = SchemaRefused("It does not know its migrations bookings.0999_full_days.")
    for now_s in (0.0, DATABASE_S):
        without.is_away(now_s, refused)
    assert "the database belongs to another release" in watched.letters[0].subject


# --- the parts ------------------------------------------------------------------------------------


def test_a_supervisor_that_ended_or_is_frozen_is_found(settings: LazySettings, tmp_path: Any) -> None:
    settings.FLEET_RUN_DIR = tmp_path
    lock = tmp_path / LOCK
    assert list(checks.supervisor()) == []  # a web computer
    with only_instance(lock):
        assert list(checks.supervisor()) == []
        os.utime(lock, (time.time() - 60.0,) * 2)
        (frozen,) = checks.supervisor()
        forget(lock)
        assert len(list(checks.supervisor())) == 1
    (ended,) = checks.supervisor()
    assert ("frozen for" in frozen.words, "has ended" in ended.words) == (True, True)
    forget(lock)  # by `script/serve web`: the computer has another role now
    assert list(checks.supervisor()) == []


def test_a_robot_whose_bridge_is_gone_is_found(robot: Robot, settings: LazySettings, tmp_path: Any) -> None:
    settings.FLEET_RUN_DIR = tmp_path
    Robot.objects.update(enabled=True)
    (trouble,) = checks.robots()
    assert (trouble.kind, trouble.subject, trouble.robot) == ("bridge", robot.slug, robot)


def test_why_a_robot_does_not_answer_is_translated(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    Robot.objects.update(enabled=True)
    why = say("No ROS master answers at {uri} ({error}).", uri="http://tiago:11311", error="refused")
    state = SimpleNamespace(phase="waiting", text=str(why), sentence=why)
    monkeypatch.setattr(checks, "state_once", lambda *_: state)
    (trouble,) = checks.robots()
    with translation.override("de"):
        assert in_words(trouble.words).startswith("TIAGo 1 antwortet nicht: Kein ROS-Master")


@pytest.mark.django_db
def test_backup_disk_redis_and_certificate(settings: LazySettings, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [one.kind for one in checks.backup()] == ["backup"]
    assert list(checks.redis()) == []
    settings.CHANNEL_LAYERS = {"default": {"CONFIG": {"hosts": ["redis://127.0.0.1:9/0"]}}}
    assert [one.kind for one in checks.redis()] == ["redis"]
    usage = type("Usage", (), {"free": 10**8, "total": 10**12})
    monkeypatch.setattr(checks.shutil, "disk_usage", lambda _path: usage)
    assert "0.1 GB are left" in next(checks.disk()).words
    now, day = timezone.now(), timedelta(days=1)
    times = {
        "fleet.example": (now - 60 * day, now + 5 * day),
        "other": (now - 60 * day, now + 90 * day),
        "short": (now - day / 4, now + day / 4),
    }
    monkeypatch.setattr(checks, "_times", lambda: times.items())
    certificates = checks.Certificates()
    assert [one.subject for one in certificates()] == ["fleet.example"]
    monkeypatch.setattr(checks, "CERTIFICATES_S", -1.0)
    monkeypatch.setattr(checks, "_times", lambda: ())  # nobody answers there now
    assert [one.subject for one in certificates()] == ["fleet.example"]


def test_a_certificate_is_told_by_the_day_on_which_it_ends(watched: Watched) -> None:
    ends = datetime(2026, 12, 5, tzinfo=UTC)
    words = say("The certificate of {name} ends on {day:day}.", name="fleet.lab.example", day=ends)
    watched.watch._checks[("certificate",)] = lambda: iter([Trouble("certificate", "fleet", words)])
    assert watched.look(0) == ["The certificate of fleet.lab.example ends on 05 Dec 2026."]
    assert watched.look(2) == ["TIAGo 1 is gone"]


def test_an_alert_that_cannot_be_told_silences_no_other(watched: Watched) -> None:
    now = {"began_at": NOW, "seen_at": NOW}
    Alert.objects.create(kind="disk", subject="x", said=["{free:.1f} GB", {"free": "?"}], **now)
    watched.watch._checks[("disk",)] = lambda: iter([Trouble("disk", "x", say("{free:.1f} GB", free="?"))])
    watched.look(0)
    assert watched.look(2) == ["TIAGo 1 is gone"]


@pytest.mark.django_db
def test_a_recording_that_waits_long_for_the_object_store_is_found(
    robot: Robot, settings: LazySettings
) -> None:
    now = timezone.now()

    def recorded(ago: timedelta, place: Place = Place.DIRECTORY) -> None:
        times = {"begins_at": now - ago - timedelta(minutes=1), "ends_at": now - ago}
        Recording.objects.create(robot=robot, kind="by_hand", file="one.mcap", place=place, **times)

    recorded(timedelta(hours=3), Place.S3)
    recorded(timedelta(hours=1))
    recorded(timedelta(days=30))
    settings.FLEET_S3 = object()
    assert list(checks.store()) == []
    recorded(timedelta(hours=3))
    (trouble,) = checks.store()
    assert trouble.kind == "store" and "for 180 min" in trouble.words
    settings.FLEET_S3 = None
    assert list(checks.store()) == []


# --- pages ----------------------------------------------------------------------------------------


@pytest.fixture
def gone(robot: Robot) -> Alert:
    return Alert.objects.create(
        kind="robot",
        subject=robot.slug,
        robot=robot,
        said=say("{robot} does not answer: {why}", robot=robot.name, why=say("no odometry")).parts,
        began_at=timezone.now() - timedelta(days=3),
        seen_at=timezone.now(),
    )


@pytest.fixture
def looking(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[float | None], None]]:
    """This process looked so many seconds ago; None: it does not look."""

    def ago(seconds: float | None) -> None:
        looked_s = None if seconds is None else time.monotonic() - seconds
        monkeypatch.setattr("teleop.alerts.watch._looked_s", looked_s)

    ago(0.0)
    yield ago


def test_what_nobody_looked_at_is_not_said_to_be_well(
    client: Client, staff: User, robot: Robot, looking: Callable[[float | None], None]
) -> None:
    Robot.objects.update(enabled=True)
    client.force_login(staff)
    for age_s, known in ((1.0, True), (STALE_S, False), (None, False)):
        looking(age_s)
        page = client.get("/status/").content.decode()
        assert (">well<" in page, ">not known<" in page) == (known, not known)
        assert ("is not known: this web process" in page) != known
        health = client.get("/healthz?all=1")
        assert (health.status_code == 200, health.json()["looked_s"]) == (known, age_s)
        assert client.get("/healthz").status_code == 200  # in a proxy
        samples = [sample.name for metric in AlertCollector().collect() for sample in metric.samples]
        assert ("fleet_alert" in samples) == known
        assert ("fleet_alerts_last_look_timestamp_seconds" in samples) == (age_s is not None)


def test_a_round_that_ends_is_a_look(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("teleop.alerts.watch._looked_s", None)
    watched.watch._round()
    assert knows()


def test_the_status_page_shows_what_the_person_may_see(
    client: Client, gone: Alert, robot: Robot, observer: User, stranger: User, staff: User
) -> None:
    Robot.objects.update(enabled=True)
    pages = {}
    for person in (observer, stranger, staff):
        client.force_login(person)
        pages[person] = client.get("/status/")
    assert pages[stranger].status_code == 403
    assert "TIAGo 1 does not answer: no odometry" in pages[observer].content.decode()
    assert [line.name for line in pages[observer].context["lines"]] == ["TIAGo 1"]
    assert [line.name for line in pages[staff].context["lines"]] == ["Console", "TIAGo 1"]


def test_ninety_days_of_a_robot(gone: Alert, robot: Robot) -> None:
    Alert.objects.create(
        kind="bridge", subject="x", robot=robot, said=["-"], seen_at=timezone.now(),
        began_at=timezone.now() - timedelta(days=2), over_at=timezone.now() - timedelta(days=1),
    )  # fmt: skip
    (line,) = lines([robot], console=False)
    assert len(line.days) == 90 and line.days[0].level == 0 and line.days[-2].level == 3
    assert line.days[-2].words.endswith("1440 min")  # two alerts at once are one time away
    assert line.share == pytest.approx(100.0 * 87 / 90, abs=0.01)


def test_staff_change_the_rules(client: Client, staff: User, operator: User) -> None:
    client.force_login(operator)
    assert client.get("/status/rules/").status_code == 403
    client.force_login(staff)
    page = client.get("/status/rules/")
    sent = {
        field.html_name: field.value()
        for form in page.context["forms"]
        for field in form
        if field.value() is not None and field.value() is not False
    }
    wrong = client.post("/status/rules/", {**sent, "backup-to": "nobody", "robot-quiet_from": "22:00"})
    assert "nobody is no e-mail address." in wrong.content.decode()
    assert "Quiet times have a begin and an end." in wrong.content.decode()
    assert not AlertRule.objects.exists()
    done = client.post("/status/rules/", {**sent, "backup-to": "a@lab.example", "backup-again_h": "48"})
    assert done.status_code == 302, [form.errors for form in done.context["forms"]]
    (rule,) = AlertRule.objects.all()
    assert (rule.kind, rule.addresses, rule.again_h) == ("backup", ["a@lab.example"], 48)
    assert Record.objects.get(kind="alert.rule").parameters["kind"] == "backup"


def test_health_tells_a_gone_robot_from_a_console_that_is_fine(
    client: Client, gone: Alert, looking: object
) -> None:
    assert client.get("/healthz?all=1").json()["needs"] == {}  # a rule that is off, or the first minutes
    Alert.objects.update(told_at=timezone.now())
    usual, everything = client.get("/healthz"), client.get("/healthz?all=1")
    assert (usual.status_code, usual.json()["needs"]) == (200, {"robot": 1})
    assert everything.status_code == 503
    Alert.objects.update(over_at=timezone.now())
    assert client.get("/healthz?all=1").json() == {"ok": True, "text": "Ready.", "needs": {}, "looked_s": 0}


def test_the_rules_for_prometheus_name_metrics_that_exist(
    client: Client, staff: User, looking: object
) -> None:
    client.force_login(staff)
    known = set(re.findall(r"^# HELP (\w+)", client.get("/metrics").text, re.MULTILINE))
    rules = yaml.safe_load((REPOSITORY / "deploy/prometheus-rules.yml").read_text())["groups"][0]["rules"]
    named = {name for rule in rules for name in re.findall(r"\bfleet_\w+", rule["expr"])}
    assert named <= known and "fleet_alert" in named


@pytest.mark.django_db
def test_a_failing_database_ends_no_watch(watched: Watched, monkeypatch: pytest.MonkeyPatch) -> None:
    watch, rounds = watched.watch, []

    def fail(_now: datetime | None = None) -> None:
        rounds.append(1)
        raise OperationalError("away") if len(rounds) < 4 else SystemExit

    def away(_function: object) -> None:  # also asks a database that is away
        raise OperationalError("away")

    watch._without.know(AlertRule(kind="database", after_min=1, again_h=24))
    monkeypatch.setattr(telling.emails.transaction, "on_commit", away)
    monkeypatch.setattr("teleop.alerts.watch.EVERY_S", 0.0)
    monkeypatch.setattr("teleop.alerts.watch.DATABASE_S", 0.0)
    monkeypatch.setattr(watch, "look", fail)
    with pytest.raises(SystemExit):
        watch._run()
    assert len(rounds) == 4 and len(watched.letters) == 1
