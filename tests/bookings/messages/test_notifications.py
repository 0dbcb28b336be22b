"""E-mails about bookings, and calendar feeds."""

from datetime import UTC, datetime, timedelta
from smtplib import SMTPDataError, SMTPRecipientsRefused, SMTPSenderRefused
from unittest.mock import Mock

import pytest
from django.core.mail.backends.locmem import EmailBackend
from django.urls import reverse
from django.utils import timezone as django_timezone
from django.utils.translation import get_language, override
from icalendar import Calendar

from fleet.accounts.models import User
from fleet.accounts.services import account_erase
from fleet.audit.command_line import here
from fleet.audit.models import Record
from fleet.bookings.changes.policy_changes import out_of_service_add
from fleet.bookings.messages import notifications
from fleet.bookings.models import Booking, FeedAddress, Notification, State
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_cancel, booking_make
from robots.access.services import role_set

pytestmark = pytest.mark.django_db

NOW = datetime(2026, 3, 2, 9, 0, tzinfo=UTC)


def at(hours):
    return NOW + timedelta(hours=hours)


def book(robot, person, begins_h=3, now=NOW):
    slot = Slot(now + timedelta(hours=begins_h), now + timedelta(hours=begins_h + 1))
    return booking_make(robot=robot, person=person, slot=slot, now=now)


@pytest.fixture
def olga(operator):
    operator.email = "olga@example.org"
    operator.save()
    return operator


def test_a_reminder_comes_once_within_the_last_hour(robot, olga, mailoutbox):
    book(robot, olga)
    notifications.write_reminders(at(1.9))
    assert Notification.objects.count() == 0
    for _ in range(2):
        notifications.write_reminders(at(2.1))
        notifications.send_notifications(at(2.1))
    [mail] = mailoutbox
    assert (mail.to, mail.subject) == (["olga@example.org"], "TIAGo 1 is yours soon")
    assert "Mon 02 Mar 2026, 12:00" in mail.body


def test_a_reminder_that_could_not_be_written_comes_later(robot, olga, monkeypatch):
    book(robot, olga)
    with monkeypatch.context() as patch, pytest.raises(OSError, match="disk"):
        patch.setattr(notifications, "notification_write", Mock(side_effect=OSError("disk full")))
        notifications.write_reminders(at(2.1))
    notifications.write_reminders(at(2.2))
    assert Notification.objects.count() == 1


def test_a_slot_booked_a_moment_before_needs_no_reminder(robot, olga):
    book(robot, olga, 0.5)
    notifications.write_reminders(at(0.1))
    assert Notification.objects.count() == 0


def test_words_about_a_change_are_in_its_owners_language(robot, olga, supervisor, settings):
    settings.LANGUAGES = [("en-gb", "English"), ("es", "español")]
    olga.language, olga.time_zone = "es", "Asia/Tokyo"
    booking = book(robot, olga)
    with override("en-gb"):
        zone = django_timezone.get_current_timezone_name
        notifications.changed_by_another(booking, supervisor, get_language, NOW, zone)
    [told] = Notification.objects.all()
    assert told.subject.endswith(": es")
    assert told.text.endswith("\nAsia/Tokyo")


def test_a_notification_says_why_others_changed_a_booking(robot, olga, supervisor, mailoutbox):
    booking = book(robot, olga)
    booking_cancel(booking_id=booking.pk, version=1, actor=supervisor, now=NOW, reason="demo day")
    book(robot, olga, now=at(-24))
    period = {"starts_at": at(-48), "ends_at": None, "why": "repair", "note": "wheel"}
    out_of_service_add(robot=robot, **period, actor=supervisor, now=NOW)
    notifications.send_notifications(NOW + timedelta(seconds=1))
    [mail] = mailoutbox  # the repair affects neither the cancelled booking nor one that is over
    assert "cancelled" in mail.subject
    assert "Sue Pervisor" in mail.body and "demo day" in mail.body


def test_news_stand_on_the_pages_until_they_are_seen(robot, operator, supervisor, signed_in, mailoutbox):
    now = django_timezone.now()
    booking = book(robot, operator, now=now)
    booking_cancel(booking_id=booking.pk, version=1, actor=supervisor, now=now, reason="demo day")
    page = signed_in(operator)
    shown = page.get("/")
    assert "Your booking of TIAGo 1: cancelled" in shown.content.decode()
    assert "Your booking of TIAGo 1" not in signed_in(supervisor).get("/").content.decode()
    assert "Your booking of TIAGo 1" not in page.get(f"/robots/{robot.slug}/").content.decode()
    notifications.send_notifications(now)
    assert not mailoutbox  # no address
    later = Notification.objects.create(person=operator, subject="Meanwhile", text="", made_at=now)
    seen = {"newest": shown.context["news"][0].pk, "next": "/bookings/"}
    assert page.post("/bookings/news/seen/", seen).url == "/bookings/"
    assert notifications.notifications_unseen([operator.pk], now) == {operator.pk: [later]}
    notifications.remove_old_notifications(now + timedelta(days=31))
    assert not Notification.objects.exists()


def test_an_erased_persons_notifications_and_purposes_are_gone(robot, operator, supervisor):
    booking = book(robot, operator, now=django_timezone.now())
    Booking.objects.update(purpose="my thesis")
    booking_cancel(booking_id=booking.pk, version=1, actor=supervisor, now=NOW)
    account_erase(user=operator, actor=here())
    assert not Notification.objects.exists()
    assert Booking.objects.get().purpose == ""


def test_ones_own_cancel_sends_nothing(robot, olga):
    booking = book(robot, olga)
    booking_cancel(booking_id=booking.pk, version=1, actor=olga, now=NOW)
    assert Notification.objects.count() == 0


def test_a_dead_mail_server_delays_a_notification_and_loses_none(robot, olga, mailoutbox, monkeypatch):
    book(robot, olga)
    notifications.write_reminders(at(2.1))

    def away(*_args):
        raise TimeoutError("timed out")

    with monkeypatch.context() as patch:
        patch.setattr(EmailBackend, "open", away, raising=False)
        assert notifications.send_notifications(at(2.1)) == 0
    sent = notifications.send_notifications(at(2.1) + timedelta(minutes=1))
    assert sent == 0, "another process may still send it"
    assert notifications.send_notifications(at(2.1) + timedelta(minutes=6)) == 1
    assert len(mailoutbox) == 1


def test_a_private_address_serves_ones_bookings_until_it_ends(client, robot, operator):
    booking = book(robot, operator, now=django_timezone.now())
    client.force_login(operator)
    page = client.post(reverse("bookings-address")).content.decode()
    address = page.split('value="http://testserver')[1].split('"')[0]
    client.logout()
    calendar = Calendar.from_ical(client.get(address).content)
    [event] = calendar.walk("VEVENT")
    assert event.decoded("dtstart") == booking.starts_at.replace(microsecond=0)
    assert FeedAddress.objects.get().digest not in address
    client.force_login(operator)
    client.post(reverse("bookings-address"))  # a new address ends the old one
    client.logout()
    assert client.get(address).status_code == 404


def test_a_robots_feed_ends_with_the_right_to_see_it(client, robot, operator, staff):
    client.force_login(operator)
    page = client.post(reverse("bookings-address"), {"robot": robot.slug}).content.decode()
    address = page.split('value="http://testserver')[1].split('"')[0]
    client.logout()
    assert client.get(address).status_code == 200
    role_set(robot=robot, user=operator, role=None, actor=staff)
    assert client.get(address).status_code == 404


@pytest.mark.parametrize(("code", "is_over"), [(550, True), (450, False)])
def test_an_address_that_is_refused_keeps_no_other_notification_back(
    robot, olga, second_operator, monkeypatch, mailoutbox, code, is_over
):
    second_operator.email = "olaf@example.org"
    second_operator.save()
    for person in (olga, second_operator):
        notifications.notification_write(to=person, subject="A slot", text="yours", now=NOW)
    send = EmailBackend.send_messages

    def refuse_olga(self, messages):
        if messages[0].to == ["olga@example.org"]:
            raise SMTPRecipientsRefused({"olga@example.org": (code, b"no such mailbox")})
        return send(self, messages)

    monkeypatch.setattr(EmailBackend, "send_messages", refuse_olga)
    notifications.send_notifications(NOW)
    assert [one.to for one in mailoutbox] == [["olaf@example.org"]]
    olga.refresh_from_db()
    assert (olga.email_refused_at is not None) == is_over
    assert Record.objects.filter(kind="account.email_refused").exists() == is_over
    monkeypatch.undo()
    # A refused letter is over, another is tried again
    notifications.send_notifications(NOW + timedelta(minutes=6))
    assert [one.to for one in mailoutbox[1:]] == ([] if is_over else [["olga@example.org"]])
    notifications.notification_write(to=olga, subject="Another slot", text="yours", now=NOW)
    notifications.send_notifications(NOW + timedelta(minutes=12))
    olga.refresh_from_db()
    assert olga.email_refused_at is None, "the server took the last e-mail"


@pytest.mark.parametrize(
    ("error", "tries"),
    [
        (SMTPSenderRefused(553, b"sender not allowed", "us"), 1),  # it would refuse each: the round ends
        (SMTPDataError(550, b"5.4.5 daily sending limit exceeded"), 2),
    ],
)
def test_a_refused_sender_or_quota_loses_nothing_and_marks_nobody(
    olga, second_operator, monkeypatch, mailoutbox, caplog, error, tries
):
    second_operator.email = "olaf@example.org"
    second_operator.save()
    for person in (olga, second_operator):
        notifications.notification_write(to=person, subject="A slot", text="yours", now=NOW)
    with monkeypatch.context() as patch:
        refuse = Mock(side_effect=error)
        patch.setattr(EmailBackend, "send_messages", refuse)
        assert notifications.send_notifications(NOW) == 0
    assert refuse.call_count == tries
    assert Notification.objects.filter(sent_at=None).count() == 2
    assert not User.objects.exclude(email_refused_at=None).exists()
    assert error.smtp_error.decode() in caplog.text
    assert notifications.send_notifications(NOW + timedelta(minutes=6)) == 2


@pytest.mark.django_db(transaction=True)
def test_an_erased_persons_bookings_are_freed_at_once(robot, operator):
    booking = book(robot, operator, now=django_timezone.now())
    account_erase(user=operator, actor=here())
    booking.refresh_from_db()
    assert booking.state == State.CANCELLED
