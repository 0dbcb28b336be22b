"""Checks of leases. No database, no clock."""

from datetime import UTC, datetime, timedelta
from uuid import UUID

import msgspec
import pytest

from robots.registry.models import Role
from teleop.control import lease_checks
from teleop.control.lease_checks import LeaseState, Phase, Tab, Waiter

NOW = datetime(2026, 1, 5, 12, 0, tzinfo=UTC)
OLGA, OLAF = UUID(int=1), UUID(int=2)
HER_TAB = Tab("her-tab", "her-sign-in", "connection-1")
HIS_TAB = Tab("his-tab", "his-sign-in", "connection-2")
HELD = LeaseState(
    session=UUID(int=9),
    user=OLGA,
    name="Olga",
    tab=HER_TAB,
    role=Role.OPERATOR,
    fence=5,
    term_ends_at=NOW + timedelta(minutes=15),
    seen_at=NOW,
    started_at=NOW,
)
LOST = msgspec.structs.replace(HELD, tab=msgspec.structs.replace(HER_TAB, connection=""))
HE_ASKS = Waiter(id=1, user=OLAF, name="Olaf", tab=HIS_TAB)
NEW_CONNECTION = msgspec.structs.replace(HER_TAB, connection="connection-3")


def after(seconds):
    return NOW + timedelta(seconds=seconds)


def code(refusal):
    return refusal and refusal.code


# --- take -----------------------------------------------------------------------------------------


def test_free_robot_may_be_taken():
    assert lease_checks.check_take(None, user=OLAF, tab=HIS_TAB, now=NOW) is None


def test_held_robot_may_not_be_taken_and_its_holder_is_named():
    refusal = lease_checks.check_take(HELD, user=OLAF, tab=HIS_TAB, now=NOW)
    assert refusal.code == "held"
    assert refusal.figures == {"holder": "Olga", "remaining_s": 900}


def test_others_see_when_a_robot_with_a_lost_page_is_free():
    refusal = lease_checks.check_take(LOST, user=OLAF, tab=HIS_TAB, now=after(4))
    assert refusal.code == "held_away"
    assert refusal.figures["resumable_s"] == 6.0


def test_robot_may_be_taken_after_the_grace():
    assert lease_checks.check_take(LOST, user=OLAF, tab=HIS_TAB, now=after(10.001)) is None


def test_robot_may_be_taken_after_the_term():
    still_there = msgspec.structs.replace(HELD, seen_at=after(900))
    assert lease_checks.check_take(still_there, user=OLAF, tab=HIS_TAB, now=after(900)) is None


def test_holder_may_move_control_to_another_tab():
    assert lease_checks.check_take(HELD, user=OLGA, tab=HIS_TAB, now=NOW) is None


def test_page_in_control_may_not_take_again():
    assert code(lease_checks.check_take(HELD, user=OLGA, tab=HER_TAB, now=NOW)) == "already_yours"


# --- resume ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [0, 9.9, 10])
def test_same_tab_resumes_within_ten_seconds(seconds):
    assert lease_checks.check_resume(LOST, user=OLGA, tab=NEW_CONNECTION, now=after(seconds)) is None


def test_same_tab_does_not_resume_after_ten_seconds():
    assert (
        code(lease_checks.check_resume(LOST, user=OLGA, tab=NEW_CONNECTION, now=after(10.1))) == "lease_over"
    )


def test_duplicated_tab_resumes_while_the_first_is_open():
    assert lease_checks.check_resume(HELD, user=OLGA, tab=NEW_CONNECTION, now=NOW) is None


@pytest.mark.parametrize("tab", [Tab("other-tab", "her-sign-in", "c"), Tab("her-tab", "other-sign-in", "c")])
def test_another_tab_or_sign_in_does_not_resume(tab):
    assert code(lease_checks.check_resume(LOST, user=OLGA, tab=tab, now=NOW)) == "not_holder"


def test_another_person_does_not_resume_with_the_tabs_token():
    assert code(lease_checks.check_resume(LOST, user=OLAF, tab=NEW_CONNECTION, now=NOW)) == "not_holder"


# --- renew, ask, hand over ----------------------------------------------------------------------------


def test_holder_may_renew():
    assert lease_checks.check_renew(HELD, tab=HER_TAB, line=[], now=NOW) is None


def test_holder_may_not_renew_while_another_person_asks():
    refusal = lease_checks.check_renew(HELD, tab=HER_TAB, line=[HE_ASKS], now=NOW)
    assert refusal.code == "somebody_asks"
    assert "Olaf" in refusal.text


def test_only_the_page_in_control_renews():
    assert code(lease_checks.check_renew(HELD, tab=NEW_CONNECTION, line=[], now=NOW)) == "not_holder"
    assert code(lease_checks.check_renew(None, tab=HER_TAB, line=[], now=NOW)) == "no_lease"
    assert code(lease_checks.check_renew(HELD, tab=HER_TAB, line=[], now=after(900))) == "lease_over"


def test_only_control_of_another_person_can_be_asked_for():
    assert lease_checks.check_other_holds(HELD, user=OLAF, now=NOW) is None
    assert code(lease_checks.check_other_holds(HELD, user=OLGA, now=NOW)) == "already_yours"
    assert code(lease_checks.check_other_holds(None, user=OLAF, now=NOW)) == "free"


def test_handover_needs_a_person_who_waits():
    assert lease_checks.check_waits(HE_ASKS) is None
    assert code(lease_checks.check_waits(None)) == "no_such_request"


def test_an_offer_holds_until_its_time():
    offered = msgspec.structs.replace(HE_ASKS, offer_until=after(30))
    assert lease_checks.offered([HE_ASKS, offered], NOW) == offered
    assert lease_checks.offered([HE_ASKS, offered], after(30)) is None


# --- take over, clear -----------------------------------------------------------------------------


def test_supervisor_may_take_over():
    assert lease_checks.check_take_over(HELD, user=OLAF, supervises=True, now=NOW) is None


def test_operator_may_not_take_over():
    assert code(lease_checks.check_take_over(HELD, user=OLAF, supervises=False, now=NOW)) == "role_too_low"


def test_free_robot_cannot_be_taken_over():
    assert code(lease_checks.check_take_over(None, user=OLAF, supervises=True, now=NOW)) == "free"
    assert code(lease_checks.check_take_over(HELD, user=OLGA, supervises=True, now=NOW)) == "already_yours"


def test_holder_and_supervisor_may_clear_the_stop():
    assert lease_checks.check_clear(HELD, tab=HER_TAB, supervises=False, now=NOW) is None
    assert lease_checks.check_clear(None, tab=None, supervises=True, now=NOW) is None
    assert code(lease_checks.check_clear(HELD, tab=HIS_TAB, supervises=False, now=NOW)) == "may_not_clear"
    assert code(lease_checks.check_clear(None, tab=HER_TAB, supervises=False, now=NOW)) == "may_not_clear"


# --- time -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lease", "seconds", "phase"),
    [
        (None, 0, Phase.FREE),
        (HELD, 0, Phase.HELD),
        (HELD, 5.1, Phase.AWAY),  # its page sent nothing for too long
        (LOST, 0, Phase.AWAY),
        (LOST, 10, Phase.AWAY),
        (LOST, 10.1, Phase.LAPSED),
        (HELD, 900, Phase.LAPSED),
    ],
)
def test_lease_passes_through_its_phases(lease, seconds, phase):
    assert lease_checks.phase(lease, after(seconds)) is phase


def test_term_ends_no_later_than_the_permit():
    assert lease_checks.term_end(NOW, 900, None) == after(900)
    assert lease_checks.term_end(NOW, 900, after(60)) == after(60)
    assert lease_checks.term_end(NOW, 900, after(6000)) == after(900)
