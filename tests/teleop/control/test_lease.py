"""The lease in the database: changes, races, records."""

import threading
from datetime import UTC, datetime, timedelta
from uuid import uuid4

import pytest
from django.db import OperationalError, connection

from fleet.audit import services as audit
from fleet.audit.models import Record
from fleet.bookings.models import Waiting
from robots.registry.models import Robot, RobotRole
from robots.shared.wire import Refusal
from teleop.control import services
from teleop.control.lease_checks import Tab
from teleop.control.selectors import end_notes, lease_of, line_of
from teleop.control.waiting import line
from teleop.models import ControlSession, EndReason, Lease
from tests.teleop.support import unavailable

pytestmark = pytest.mark.django_db(transaction=True)

NOW = datetime(2026, 1, 5, 12, 0, tzinfo=UTC)


def tab(name):
    return Tab(f"{name}-tab", f"{name}-sign-in", f"{name}-connection")


def take(robot, user, *, name=None, highest_fence=0, now=NOW):
    return services.lease_take(
        robot_id=robot.id,
        user_id=user.id,
        tab=tab(name or user.username),
        highest_fence=highest_fence,
        now=now,
    )


def ask(robot, user):
    return line.line_join(robot_id=robot.id, user_id=user.id, tab=tab(user.username), now=NOW)


def hand_over(robot, holder, request):
    return services.lease_hand_over(
        robot_id=robot.id,
        user_id=holder.id,
        tab=tab(holder.username),
        request_id=request,
        highest_fence=0,
        now=NOW,
    )


def take_over(robot, user):
    services.lease_take_over(
        robot_id=robot.id,
        user_id=user.id,
        tab=tab(user.username),
        reason="fire drill",
        highest_fence=0,
        now=NOW,
    )


def give_back(robot, held):
    services.lease_end(
        robot_id=robot.id, session=held.session, reason=EndReason.RELEASED, user_id=held.user, now=NOW
    )


def refused(step, *args, **kwargs):
    with pytest.raises(services.ControlRefused) as caught:
        step(*args, **kwargs)
    return caught.value.refusal


def kinds():
    return list(
        Record.objects.filter(kind__startswith="control.").order_by("id").values_list("kind", flat=True)
    )


# --- take -----------------------------------------------------------------------------------------


def test_take_starts_a_session_recorded_with_its_fence(robot, operator):
    held = take(robot, operator)
    session = ControlSession.objects.get(pk=held.session)
    record = Record.objects.get(kind="control.take")
    assert (session.user, session.fence, session.ended_at) == (operator, held.fence, None)
    assert (record.session_id, record.fence, record.actor_id) == (held.session, held.fence, str(operator.pk))


def test_fence_is_higher_than_all_before(robot, operator, second_operator):
    first = take(robot, operator)
    give_back(robot, first)
    second = take(robot, second_operator)
    assert second.fence > first.fence


def test_restored_database_does_not_repeat_a_fence(robot, operator):
    assert take(robot, operator, highest_fence=70).fence == 71


def test_one_of_two_simultaneous_takes_wins(robot, operator, second_operator):
    together = threading.Barrier(2)
    results = {}

    def race(user):
        together.wait()
        try:
            results[user.username] = take(robot, user)
        except services.ControlRefused as error:
            results[user.username] = error.refusal
        finally:
            connection.close()

    racers = [threading.Thread(target=race, args=(user,)) for user in (operator, second_operator)]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join()

    losers = [result for result in results.values() if isinstance(result, Refusal)]
    assert [refusal.code for refusal in losers] in (["held"], ["too_late"])
    assert ControlSession.objects.filter(ended_at=None).count() == 1
    assert kinds() == ["control.take"]


def test_changed_lease_is_not_changed_again(robot, operator, second_operator, monkeypatch):
    """With parallel transactions, the count of changed rows shows which one lost."""
    take(robot, second_operator)
    monkeypatch.setattr(services, "lease_of", lambda _robot_id: None)  # an outdated read
    assert refused(take, robot, operator).code == "too_late"
    monkeypatch.undo()
    assert lease_of(robot.id).user == second_operator.id
    assert kinds() == ["control.take"]


def test_observers_and_strangers_get_no_control(robot, observer, stranger):
    for person in (observer, stranger):
        assert refused(take, robot, person).code == "role_too_low"


def test_disabled_robot_gives_no_control(robot, staff):
    Robot.objects.update(enabled=False)
    assert refused(take, robot, staff).code == "robot_disabled"


def test_closed_account_gets_no_control(robot, operator):
    operator.is_active = False
    operator.save()
    assert refused(take, robot, operator).code == "account_inactive"


def test_take_in_another_tab_moves_control_to_a_new_fence(robot, operator):
    first = take(robot, operator, name="one")
    second = take(robot, operator, name="two")
    assert second.fence > first.fence
    assert ControlSession.objects.get(pk=first.session).end_reason == EndReason.MOVED


def test_control_that_cannot_be_recorded_is_not_granted(robot, operator, monkeypatch):
    monkeypatch.setattr(audit, "record", unavailable)
    refusal = refused(take, robot, operator)
    assert (refusal.code, refusal.rule) == ("audit_disk_full", "audit")
    assert lease_of(robot.id) is None
    assert not ControlSession.objects.exists()


# --- keep -----------------------------------------------------------------------------------------


def test_renewal_starts_a_new_term(robot, operator, settings):
    settings.FLEET_CONTROL_TERM_S = 60
    take(robot, operator)
    later = NOW + timedelta(seconds=50)
    Lease.objects.update(seen_at=later)
    services.lease_renew(robot_id=robot.id, user_id=operator.id, tab=tab("operator"), now=later)
    assert lease_of(robot.id).term_ends_at == later + timedelta(seconds=60)


def test_renewal_is_refused_while_another_person_asks(robot, operator, second_operator):
    take(robot, operator)
    ask(robot, second_operator)
    refusal = refused(
        services.lease_renew, robot_id=robot.id, user_id=operator.id, tab=tab("operator"), now=NOW
    )
    assert refusal.code == "somebody_asks"


def test_returning_page_keeps_its_fence(robot, operator):
    held = take(robot, operator)
    services.lease_page_gone(
        robot_id=robot.id, session=held.session, connection="operator-connection", now=NOW
    )
    back = Tab("operator-tab", "operator-sign-in", "new-connection")
    services.lease_resume(robot_id=robot.id, user_id=operator.id, tab=back, now=NOW + timedelta(seconds=9))
    again = lease_of(robot.id)
    assert (again.session, again.fence, again.tab.connection) == (held.session, held.fence, "new-connection")


def test_resume_is_refused_after_the_grace(robot, operator):
    held = take(robot, operator)
    services.lease_page_gone(
        robot_id=robot.id, session=held.session, connection="operator-connection", now=NOW
    )
    refusal = refused(
        services.lease_resume,
        robot_id=robot.id,
        user_id=operator.id,
        tab=tab("operator"),
        now=NOW + timedelta(seconds=11),
    )
    assert refusal.code == "lease_over"


def test_resume_is_refused_when_the_right_has_ended(robot, operator):
    take(robot, operator)
    RobotRole.objects.filter(user=operator).update(role="observer")
    refusal = refused(
        services.lease_resume, robot_id=robot.id, user_id=operator.id, tab=tab("operator"), now=NOW
    )
    assert refusal.code == "role_too_low"


# --- hand over, take over, end------------------------------------------------------------------------


def test_handover_gives_control_to_the_page_that_asked(robot, operator, second_operator):
    before = take(robot, operator)
    given = hand_over(robot, operator, ask(robot, second_operator))
    assert (given.user, given.tab) == (second_operator.id, tab("second"))
    assert given.fence > before.fence
    assert ControlSession.objects.get(pk=before.session).end_reason == EndReason.HANDED_OVER
    assert not line_of(robot.id, NOW)


def test_handover_to_a_withdrawn_request_is_refused(robot, operator, second_operator):
    take(robot, operator)
    number = ask(robot, second_operator)
    line.line_leave(robot_id=robot.id, user_id=second_operator.id, connection="second-connection", now=NOW)
    assert refused(hand_over, robot, operator, number).code == "no_such_request"


def test_asking_twice_makes_one_request(robot, operator, second_operator):
    take(robot, operator)
    ask = {"robot_id": robot.id, "user_id": second_operator.id, "now": NOW}
    assert line.line_join(tab=tab("one"), **ask) == line.line_join(tab=tab("two"), **ask)
    assert [one.tab.token for one in line_of(robot.id, NOW)] == ["two-tab"]


def test_takeover_records_its_reason(robot, operator, supervisor):
    before = take(robot, operator)
    take_over(robot, supervisor)
    ended = ControlSession.objects.get(pk=before.session)
    assert ended.end_reason == EndReason.TAKEN_OVER
    assert end_notes([before.session]) == {before.session: "Sue Pervisor took over: fire drill"}
    assert Record.objects.get(kind="control.take_over").details["text"] == "fire drill"


def test_page_seen_while_its_lease_expires_keeps_it(robot, operator, monkeypatch):
    """With parallel transactions, another process may store `seen_at` between any two steps."""
    held = take(robot, operator)
    over = NOW + timedelta(seconds=11)
    free = services._free

    def free_after_it_was_seen(*args, **kwargs):
        Lease.objects.update(seen_at=over)
        return free(*args, **kwargs)

    monkeypatch.setattr(services, "_free", free_after_it_was_seen)
    assert refused(services.lease_expire, robot_id=robot.id, now=over).code == "too_late"
    monkeypatch.undo()
    Lease.objects.update(seen_at=over)  # the value of the other process stays
    assert lease_of(robot.id).session == held.session
    assert kinds() == ["control.take"]


def test_expired_term_ends_once(robot, operator, settings):
    settings.FLEET_CONTROL_TERM_S = 60
    held = take(robot, operator)
    services.lease_expire(robot_id=robot.id, now=NOW + timedelta(seconds=9))
    assert lease_of(robot.id) == held
    over = NOW + timedelta(seconds=60)
    for _ in range(2):
        services.lease_expire(robot_id=robot.id, now=over)
        assert lease_of(robot.id) is None
    assert kinds() == ["control.take", "control.end"]


def test_session_ends_once_however_control_ends(robot, operator, second_operator, supervisor):
    def step(function, who, **more):
        return function(robot_id=robot.id, user_id=who.id, tab=tab(who.username), now=NOW, **more)

    refusal = Refusal("role_too_low", "You may not.", "account")
    held = [take(robot, operator)]
    give_back(robot, held[0])
    held += [take(robot, operator), take(robot, operator, name="operator-elsewhere")]
    step(services.lease_take_over, supervisor, reason="fire drill", highest_fence=0)
    held.append(lease_of(robot.id))
    asked = step(line.line_join, operator)
    held.append(step(services.lease_hand_over, supervisor, request_id=asked, highest_fence=0))
    services.lease_end(
        robot_id=robot.id, session=held[-1].session, reason=EndReason.RIGHT, refusal=refusal, now=NOW
    )
    held.append(take(robot, operator))
    services.lease_end(
        robot_id=robot.id, session=held[-1].session, reason=EndReason.BRIDGE, refusal=refusal, now=NOW
    )
    held.append(take(robot, operator))
    held.append(take(robot, second_operator, now=NOW + timedelta(seconds=11)))  # the page was gone
    held.append(take(robot, operator, now=NOW + timedelta(days=1)))
    ends = Record.objects.filter(kind="control.end").order_by("id")
    recorded = [(end.outcome, end.session_id, end.fence, end.parameters["holder"]) for end in ends]
    reasons = ["released", "moved", "taken_over", "handed_over", "right", "bridge", "away", "term"]
    assert recorded == [
        (reason, had.session, had.fence, str(had.user))
        for reason, had in zip(reasons, held[:-1], strict=True)
    ]
    assert {reason.value for reason in EndReason} == {*reasons, "slot"}  # "slot": test_booked_control
    by = [end.actor_id for end in ends]
    people = [operator, operator, supervisor, supervisor]
    assert by == [*(str(person.pk) for person in people), None, None, None, None]


def test_names_and_reasons_in_records_may_expire(robot, operator, supervisor):
    take(robot, operator)
    take_over(robot, supervisor)
    kept = str([record.parameters for record in Record.objects.filter(kind__startswith="control.")])
    assert str(operator.pk) in kept
    assert not [words for words in ("Olga", "Pervisor", "fire drill") if words in kept]


@pytest.mark.parametrize("outcome", ["granted", "cancelled", "gone", "lapsed", "not_allowed"])
def test_outcome_of_a_request_is_recorded(outcome, robot, operator, second_operator):
    held = take(robot, operator)
    asker, holder = tab("second"), {"robot_id": robot.id, "user_id": operator.id, "tab": tab("operator")}
    asked = line.line_join(robot_id=robot.id, user_id=second_operator.id, tab=asker, now=NOW)
    match outcome:
        case "granted":
            services.lease_hand_over(**holder, request_id=asked, highest_fence=0, now=NOW)
        case "lapsed":
            give_back(robot, held)
            line.offer_next(robot_id=robot.id, now=NOW)
            Waiting.objects.update(seen_at=NOW + timedelta(seconds=31))
            line.line_tidy(now=NOW + timedelta(seconds=31))
        case "gone":
            line.line_away(robot_id=robot.id, connection=asker.connection)
            line.line_tidy(now=NOW + timedelta(seconds=15))
        case "not_allowed":
            give_back(robot, held)
            RobotRole.objects.filter(user=second_operator).delete()
            assert not line.offer_next(robot_id=robot.id, now=NOW)
        case _:
            line.line_leave(
                robot_id=robot.id, user_id=second_operator.id, connection=asker.connection, now=NOW
            )
    ask, answer = Record.objects.filter(kind="control.ask").order_by("id")
    assert (ask.actor_id, ask.outcome) == (str(second_operator.pk), "")
    assert (answer.of_id, answer.outcome, answer.session_id) == (ask.pk, outcome, ask.session_id)


def test_ending_an_ended_session_changes_nothing(robot, operator, second_operator):
    old = take(robot, operator)
    give_back(robot, old)
    new = take(robot, second_operator)
    services.lease_end(
        robot_id=robot.id,
        session=old.session,
        reason=EndReason.RIGHT,
        refusal=Refusal("signed_out", "Signed out.", "account"),
        now=NOW,
    )
    assert lease_of(robot.id).session == new.session


def test_database_error_becomes_a_refusal(robot, operator, monkeypatch):
    def locked(_robot_id):
        raise OperationalError("database is locked")

    monkeypatch.setattr(services, "lease_of", locked)
    refusal = refused(take, robot, operator)
    assert (refusal.code, refusal.rule) == ("database_locked", "database")
    assert "another process keeps the database locked" in refusal.text


def test_only_the_holding_connection_counts_as_seen(robot, operator):
    held = take(robot, operator)
    later = NOW + timedelta(seconds=5)
    seen = {"robot_id": robot.id, "seen_at": later}
    services.lease_store_seen(session=held.session, connection="another", **seen)
    services.lease_store_seen(session=uuid4(), connection="operator-connection", **seen)
    assert lease_of(robot.id).seen_at == NOW
    services.lease_store_seen(session=held.session, connection="operator-connection", **seen)
    assert lease_of(robot.id).seen_at == later
