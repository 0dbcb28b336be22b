"""Idempotency-Key: the work is done once, also if requests are repeated."""

import threading
from datetime import timedelta

import pytest
from django.db import connection
from django.utils import timezone as clock

from fleet.bookings.changes import handing
from fleet.bookings.models import Booking
from robots.shared.wire import NotDone, Refusal
from teleop.api.v1.framework import idempotency
from teleop.models import KeyedRequest
from tests.teleop.api.test_bookings import hour, wish, words

pytestmark = pytest.mark.django_db

KEY = "3f6c8a52-night 7"


def test_a_request_sent_again_is_answered_again(robot, operator, program):
    api = program(operator)
    first = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    again = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    assert (again.status_code, again.data) == (201, first.data)
    assert (again["Location"], again["ETag"]) == (first["Location"], first["ETag"])
    assert again["Idempotent-Replayed"] == "true"
    assert "Idempotent-Replayed" not in first
    assert Booking.objects.count() == 1


def test_a_refusal_is_answered_again(robot, operator, program):
    api = program(operator)
    first = api("POST", "/bookings", wish(robot, -5), Idempotency_Key=KEY)
    again = api("POST", "/bookings", wish(robot, -5), Idempotency_Key=KEY)
    assert (again.status_code, again.data) == (409, first.data)
    assert again["Content-Type"] == "application/problem+json"
    assert again.data["refusals"][0]["code"] == "in_past"


def test_another_request_with_the_key_is_refused(robot, operator, program):
    api = program(operator)
    made = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY).data
    for path, body in (("/bookings", wish(robot, 5)), ("/waiting", wish(robot))):
        answer = api("POST", path, body, Idempotency_Key=KEY)
        assert (answer.status_code, answer.data["code"]) == (422, "key_reused"), path
    assert [str(one.pk) for one in Booking.objects.all()] == [made["id"]]


def test_keys_belong_to_one_token_or_session(robot, operator, second_operator, program, page_of):
    callers = (program(operator), program(operator), program(second_operator), page_of(operator))
    for number, caller in enumerate(callers):
        answer = caller("POST", "/bookings", wish(robot, 1 + number), Idempotency_Key=KEY)
        assert answer.status_code == 201
    assert Booking.objects.count() == 4


@pytest.mark.parametrize("key", ["", " ", "x" * 101, "schlüssel", "a\tb"])
def test_a_wrong_key_is_refused(robot, operator, program, key):
    answer = program(operator)("POST", "/bookings", wish(robot), Idempotency_Key=key)
    assert (answer.status_code, answer.data["code"]) == (400, "invalid")
    assert Booking.objects.count() == 0


def test_a_body_that_does_not_fit_claims_no_key(robot, operator, program):
    api = program(operator)
    assert api("POST", "/bookings", {"robot": 1}, Idempotency_Key=KEY).status_code == 400
    assert api("POST", "/bookings", wish(robot), Idempotency_Key=KEY).status_code == 201


def test_a_key_is_free_after_a_day(robot, operator, program):
    api = program(operator)
    api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    KeyedRequest.objects.update(made_at=clock.now() - timedelta(hours=25))
    again = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    assert again.data["code"] == "taken"
    KeyedRequest.objects.update(made_at=clock.now() - timedelta(hours=25))
    idempotency.remove_old_answers(clock.now())
    assert not KeyedRequest.objects.exists()


def test_nobody_repeats_the_work_of_a_process_that_ended(robot, operator, program, monkeypatch):
    api = program(operator)

    def dies(**_facts):
        raise SystemError("power cut")

    with monkeypatch.context() as patch:
        patch.setattr(handing, "booking_make_asking", dies)
        with pytest.raises(SystemError):
            api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    monkeypatch.setattr(idempotency, "WAIT_S", 0.1)
    answer = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    assert (answer.status_code, answer.data["code"]) == (409, "in_progress")
    KeyedRequest.objects.update(made_at=clock.now() - timedelta(seconds=61))
    answer = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    assert (answer.status_code, answer.data["code"]) == (409, "outcome_unknown")
    assert Booking.objects.count() == 0


@pytest.mark.parametrize("code", ["no_answer", "connection_lost", "not_recorded"])
def test_a_request_that_may_be_done_is_not_repeated(robot, operator, program, monkeypatch, code):
    api, times = program(operator), []

    def unsure(**_facts):
        times.append(1)
        raise NotDone(Refusal(code, "It was sent.", "audit"))

    monkeypatch.setattr(handing, "booking_make_asking", unsure)
    first = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    again = api("POST", "/bookings", wish(robot), Idempotency_Key=KEY)
    assert (first.status_code, first.data["code"]) == (503, code)
    assert (again.status_code, again.data["code"]) == (409, "outcome_unknown")
    assert len(times) == 1


@pytest.mark.django_db(transaction=True)
def test_two_requests_at_the_same_moment_book_once(robot, operator, program):
    api, body, answers = program(operator), {"robot": robot.slug}, []
    body |= {"starts_at": words(hour(1)), "ends_at": words(hour(2))}
    together = threading.Barrier(4)

    def ask():
        together.wait()
        answers.append(api("POST", "/bookings", body, Idempotency_Key=KEY))
        connection.close()

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [answer.status_code for answer in answers] == [201] * 4, [answer.data for answer in answers]
    assert len({answer.data["id"] for answer in answers}) == 1
    assert sum("Idempotent-Replayed" not in answer for answer in answers) == 1
    assert Booking.objects.count() == 1
