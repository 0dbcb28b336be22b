"""Records become deliveries: the chosen kinds, each once, none lost; events have names, but no typed words."""

import json
import threading
from datetime import UTC, datetime, timedelta

import pytest
from django.db import connection, transaction
from django.utils import timezone as django_timezone

from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks import event_reader, services
from teleop.webhooks.event_reader import EventReader
from teleop.webhooks.events import body_of
from teleop.webhooks.services import WebhookRefused

pytestmark = pytest.mark.django_db
ADDRESS = "https://93.184.216.34/"


def spoken(robot, person, text="Hello Ada"):
    facts = {"robot_id": robot.id, "robot_name": robot.name, "actor": person}
    start = record("speech.start", text=text, parameters={"language": "en_GB"}, **facts)
    return record("speech.end", of=start, outcome="done", parameters={"duration_s": 1.5}, **facts)


def kinds(webhook):
    return list(webhook.deliveries.order_by("record").values_list("kind", flat=True))


def event(webhook, texts=False):
    return json.loads(body_of(webhook.deliveries.order_by("-pk").first(), texts))


def test_news_begin_with_the_webhook_and_come_once(make, robot, operator):
    spoken(robot, operator)
    webhook, reader = make(ADDRESS), EventReader()
    end = spoken(robot, operator)
    for one in (reader, reader, EventReader()):
        one.read(webhook)
        webhook.refresh_from_db()
    assert [(one.kind, one.record) for one in webhook.deliveries.all()] == [("speech.end", end.pk)]


def test_two_processes_store_news_of_the_same_records_once(make, robot, operator):
    webhook = make(ADDRESS)
    spoken(robot, operator)
    for _ in range(2):
        EventReader().read(webhook)  # both begin at the same last record
    assert webhook.deliveries.count() == 1


def test_kinds_and_robots_are_chosen(make, robot, other_robot, operator):
    both, speech = make(ADDRESS, "both", robots=[robot]), make(ADDRESS, "speech", kinds=["speech"])
    for one in (robot, other_robot):
        facts = {"robot_id": one.id, "robot_name": one.name, "actor": operator}
        spoken(one, operator)
        record("control.take", **facts)
        record("control.renew", **facts)
        press = record("stop.press", **facts)
        record("stop.press", of=press, outcome="done", actor=operator)
        record("stop.latch", robot_id=one.id)
        clear = record("stop.clear", **facts)
        record("stop.clear", of=clear, outcome="clear", actor=operator)
        record("booking.feed", **facts)
        drive = record("drive.by", **facts)
        record("drive.by", of=drive, outcome="done", actor=operator)
    for webhook in (both, speech):
        EventReader().read(webhook)
    assert kinds(both) == ["speech.end", "control.take", "stop.press", "stop.latch", "stop.clear", "drive.by"]
    assert kinds(speech) == ["speech.end"] * 2


def test_an_event_names_people_and_quotes_nobody(make, robot, operator, staff):
    webhook = make(ADDRESS)
    end = spoken(robot, operator)
    EventReader().read(webhook)
    assert event(webhook) == {
        "id": f"rec_{end.pk}",
        "type": "speech.end",
        "timestamp": f"{end.at.astimezone(UTC):%Y-%m-%dT%H:%M:%S}.{end.at.microsecond // 1000:03}Z",
        "data": {
            "record": end.pk,
            "robot": {"slug": "tiago-1", "name": "TIAGo 1"},
            "person": "Olga Operator",
            "session": None,
            "outcome": "done",
            "figures": {"language": "en_GB", "duration_s": 1.5},
        },
    }
    assert event(webhook, texts=True)["data"]["text"] == "Hello Ada"


def test_identifiers_of_people_are_names(make, robot, operator, second_operator):
    webhook = make(ADDRESS)
    begins = django_timezone.now() + timedelta(hours=3)
    booking = booking_make(
        robot=robot,
        person=operator,
        slot=Slot(begins, begins + timedelta(hours=1)),
        now=begins - timedelta(hours=3),
    )
    EventReader().read(webhook)
    figures = event(webhook)["data"]["figures"]
    assert (figures["person"], figures["booking"]) == ("Olga Operator", str(booking.pk))
    assert datetime.fromisoformat(figures["from"]) == booking.starts_at
    before = {"person": str(operator.pk)}
    record("booking.hand", actor=second_operator, parameters={"before": before, "others": [str(operator.pk)]})
    EventReader().read(Webhook.objects.get())
    data = event(webhook)["data"]
    assert (data["robot"], data["person"]) == (None, "Olaf Operator")
    assert data["figures"] == {"before": {"person": "Olga Operator"}, "others": ["Olga Operator"]}


def test_news_names_the_console_and_who_acted_for_whom(make, robot, operator, staff):
    webhook, reader = make(ADDRESS), EventReader()
    record("control.end", robot_id=robot.id, outcome="term")
    reader.read(webhook)
    assert event(webhook)["data"]["person"] is None
    record("control.end", robot_id=robot.id, actor=operator, real_actor=staff)
    reader.read(webhook)
    data = event(webhook)["data"]
    assert (data["person"], data["real_person"]) == ("Olga Operator", "Sam Staff")


def test_a_pause_holds_news_back_and_loses_none(make, robot, operator, staff):
    webhook, reader = make(ADDRESS), EventReader()
    services.webhook_pause(webhook=webhook, actor=staff)
    spoken(robot, operator)
    assert reader.read(webhook) == 0  # the process read the webhook a moment before the pause
    services.webhook_resume(webhook=webhook, actor=staff)
    reader.read(Webhook.objects.get())
    assert kinds(webhook) == ["speech.end"]


def test_news_of_a_long_pause_are_left_out(make, robot, operator, monkeypatch):
    webhook = make(ADDRESS)
    spoken(robot, operator)
    monkeypatch.setattr(event_reader, "OLDEST", timedelta(0))
    EventReader().read(webhook)
    assert kinds(webhook) == []


def test_without_news_the_number_is_stored_seldom(make, robot, operator, monkeypatch):
    monkeypatch.setattr(event_reader, "NOTED_AFTER", 4)
    webhook, reader = make(ADDRESS), EventReader()
    first = webhook.read_to
    assert reader.read(webhook) == 1  # the record of the webhook itself
    for number in range(2, 6):
        record("drive.start", robot_id=robot.id)
        assert reader.read(webhook) == 1
        webhook.refresh_from_db()
        assert webhook.read_to == (first if number < 4 else first + 4)


def test_at_most_so_many_records_in_a_round(make, robot, operator, monkeypatch):
    monkeypatch.setattr(event_reader, "BATCH_SIZE", 4)
    webhook, reader = make(ADDRESS), EventReader()
    for _ in range(5):
        spoken(robot, operator)
    read = [reader.read(webhook) for _ in range(5)]
    assert read == [4, 4, 3, 0, 0]  # includes the record of the webhook itself
    assert kinds(webhook) == ["speech.end"] * 5


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif("connection.vendor != 'postgresql'", reason="SQLite has one writer")
def test_a_record_that_is_committed_late_is_not_lost(make, robot, other_robot, operator):
    """Records get their numbers before the commit: a higher number may be visible first."""
    webhook = make(ADDRESS)
    for one in (robot, other_robot):
        record("robot.change", robot_id=one.id)
    begun, may_end = threading.Event(), threading.Event()

    def slowly():
        with transaction.atomic():
            record("control.take", robot_id=robot.id)
            begun.set()
            may_end.wait(10)
        connection.close()

    def read():
        EventReader().read(webhook)
        connection.close()

    writer, reader = threading.Thread(target=slowly), threading.Thread(target=read)
    writer.start()
    begun.wait(10)
    record("control.end", robot_id=other_robot.id)
    reader.start()
    reader.join(0.5)
    assert reader.is_alive()  # it waits for the writer
    may_end.set()
    for thread in (writer, reader):
        thread.join(10)
    assert kinds(webhook) == ["control.take", "control.end"]


def test_only_staff_make_webhooks_and_not_too_many(make, operator, staff, monkeypatch):
    wanted = {"name": "x", "address": ADDRESS, "kinds": ["stops"]}
    with pytest.raises(WebhookRefused, match="for staff"):
        services.webhook_make(**wanted, actor=operator)
    for wrong in ([], ["stops", "gossip"]):
        with pytest.raises(WebhookRefused, match="at least one category"):
            services.webhook_make(**{**wanted, "kinds": wrong}, actor=staff)
    monkeypatch.setattr(services, "MOST", 1)
    services.webhook_make(**wanted, actor=staff)
    with pytest.raises(WebhookRefused, match="Delete one"):
        services.webhook_make(**{**wanted, "name": "y"}, actor=staff)


def test_each_change_is_recorded_without_what_may_be_secret(make, staff):
    webhook = make("https://93.184.216.34/hook/zebra?token=giraffe")
    services.webhook_pause(webhook=webhook, actor=staff)
    services.webhook_pause(webhook=webhook, actor=staff)
    services.webhook_resume(webhook=webhook, actor=staff)
    services.webhook_delete(webhook=webhook, actor=staff)
    found = Record.objects.filter(kind__startswith="webhook.").order_by("pk")
    assert [one.kind.split(".")[1] for one in found] == ["create", "pause", "resume", "delete"]
    assert all(one.actor_name == "Sam Staff" for one in found)
    assert found[0].details["host"] == "93.184.216.34" and "zebra" not in str(found[0].details)
    assert not WebhookDelivery.objects.exists()
