"""People change their own password, staff changes anybody's; both only if it can be recorded."""

from datetime import timedelta
from unittest import mock

import pytest
from django.contrib.auth.hashers import make_password
from django.core.management import call_command
from django.db import connection
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in as still_signed_in
from fleet.accounts.tokens.models import Scope, Token
from fleet.accounts.tokens.services import token_make
from fleet.audit.errors import AuditUnavailable
from fleet.audit.models import Record
from tests.conftest import PASSWORD

PAGE = "/accounts/password/"
NEW = "another long walk"
FORM = {"old_password": PASSWORD, "new_password1": NEW, "new_password2": NEW}
ADMIN_FORM = {"usable_password": "true", "password1": NEW, "password2": NEW}
FULL = AuditUnavailable("audit_disk_full", "Not done: the disk is full.")


def _has(person: User, password: str) -> bool:
    return User.objects.get(pk=person.pk).check_password(password)


@pytest.mark.django_db
def test_people_change_their_own_password_and_it_is_recorded(stranger, signed_in):
    response = signed_in(stranger).post(PAGE, FORM, follow=True)
    assert "Your password is changed." in response.content.decode()
    assert _has(stranger, NEW)
    entry = Record.objects.get(kind="account.change")
    assert (entry.actor_id, entry.parameters["changes"]) == (str(stranger.pk), [{"field": "password"}])
    assert NEW not in str(entry.details)


@pytest.mark.django_db(transaction=True)
def test_hashing_a_password_blocks_no_other_writer(stranger, signed_in):
    within = []

    def hashed(password):
        within.append(connection.in_atomic_block)
        return make_password(password)

    with mock.patch("django.contrib.auth.base_user.make_password", hashed):
        signed_in(stranger).post(PAGE, FORM)
    assert within == [False]
    assert _has(stranger, NEW)


@pytest.mark.django_db
def test_the_account_page_leads_there(stranger, signed_in):
    stranger.set_password("a long walk on the beach")
    stranger.save()
    client = signed_in(stranger)
    assert 'href="/accounts/"' in client.get("/").content.decode()
    assert f'href="{PAGE}"' in client.get("/accounts/").content.decode()


@pytest.mark.django_db
def test_the_admin_leads_there(staff, signed_in):
    assert signed_in(staff).get("/admin/password_change/").headers["Location"] == PAGE


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"old_password": "wrong"}, "Your old password was entered incorrectly"),
        ({"new_password2": "yet another"}, "match"),
        ({"new_password1": "short", "new_password2": "short"}, "too short"),
    ],
)
def test_errors_are_shown_and_nothing_is_changed(change, said, stranger, signed_in):
    response = signed_in(stranger).post(PAGE, FORM | change)
    assert said in response.content.decode()
    assert _has(stranger, PASSWORD)
    assert not Record.objects.filter(kind="account.change").exists()


@pytest.mark.django_db
def test_nobody_guesses_it_at_a_page_that_was_left_open(stranger, signed_in):
    desk = signed_in(stranger)
    for _ in range(10):
        desk.post(PAGE, FORM | {"old_password": "wrong"})
    assert "Too many failed attempts" in desk.post(PAGE, FORM).content.decode()
    assert _has(stranger, PASSWORD)


@pytest.mark.django_db(transaction=True)
def test_ones_own_is_not_changed_without_a_record(stranger, signed_in):
    desk = signed_in(stranger)
    with mock.patch("fleet.accounts.changes.record", autospec=True, side_effect=FULL):
        assert desk.post(PAGE, FORM).status_code == 503
    assert _has(stranger, PASSWORD)
    assert still_signed_in([(stranger.pk, desk.session.session_key)])


@pytest.mark.django_db(transaction=True)
def test_another_persons_is_not_changed_without_a_record(operator, staff, signed_in):
    admin = signed_in(staff)
    with mock.patch("fleet.accounts.changes.record", autospec=True, side_effect=FULL):
        assert admin.post(f"/admin/accounts/user/{operator.pk}/password/", ADMIN_FORM).status_code == 503
    assert _has(operator, PASSWORD)


@pytest.mark.django_db
def test_staff_who_edit_themselves_stay_signed_in(staff, signed_in):
    desk = signed_in(staff)
    assert desk.post(f"/admin/accounts/user/{staff.pk}/password/", ADMIN_FORM).status_code == 302
    assert still_signed_in([(staff.pk, desk.session.session_key)])
    assert Record.objects.filter(kind="account.change").count() == 1


@pytest.mark.django_db
@pytest.mark.parametrize("nobody", ["00000000-0000-0000-0000-000000000000", "nobody"])
def test_a_missing_account_has_no_password_page(nobody, staff, signed_in):
    response = signed_in(staff).post(f"/admin/accounts/user/{nobody}/password/", ADMIN_FORM)
    assert response.status_code == 404


@pytest.mark.django_db
def test_a_new_password_ends_tokens_only_if_that_is_chosen(stranger, operator, signed_in):
    assert "end_tokens" not in signed_in(stranger).get(PAGE).content.decode()  # this person has no tokens
    token_for(operator)
    kept = signed_in(operator)
    assert 'name="end_tokens" type="checkbox">' in kept.get(PAGE).content.decode()
    kept.post(PAGE, FORM)
    assert Token.objects.count() == 1
    again = {"old_password": NEW, "new_password1": PASSWORD, "new_password2": PASSWORD, "end_tokens": "on"}
    assert "1 token is ended." in kept.post(PAGE, again, follow=True).content.decode()
    assert not Token.objects.exists()
    assert Record.objects.get(kind="token.end").actor_id == str(operator.pk)


@pytest.mark.django_db
@pytest.mark.parametrize(
    "button", [{}, {"usable_password": "false", "unset-password": "on"}]
)  # another password, or none
def test_a_password_that_staff_set_ends_sign_ins_and_tokens(button, operator, staff, signed_in):
    desk, admin = signed_in(operator), signed_in(staff)
    token_for(operator)
    token_for(staff)
    answer = admin.post(f"/admin/accounts/user/{operator.pk}/password/", ADMIN_FORM | button, follow=True)
    assert "signed out everywhere" in answer.content.decode()
    assert not still_signed_in([(operator.pk, desk.session.session_key)])
    assert still_signed_in([(staff.pk, admin.session.session_key)])
    assert [token.user for token in Token.objects.all()] == [staff]
    assert Record.objects.get(kind="token.end").actor_id == str(staff.pk)
    ended = Record.objects.get(kind="account.sign_out")
    assert (ended.actor_id, ended.outcome) == (str(operator.pk), "password set by another person")


@pytest.mark.django_db
def test_the_command_line_ends_them_too(operator, signed_in):
    signed_in(operator)
    token_for(operator)
    with mock.patch("getpass.getpass", return_value=NEW):
        call_command("changepassword", operator.username)
    assert _has(operator, NEW)
    assert not Token.objects.exists()
    assert not operator.sign_ins.exists()


@pytest.mark.django_db(transaction=True)
def test_a_password_stays_while_its_tokens_end_cannot_be_recorded(operator, staff, signed_in):
    token_for(operator)
    admin = signed_in(staff)
    with mock.patch("fleet.accounts.tokens.services.record", autospec=True, side_effect=FULL):
        assert admin.post(f"/admin/accounts/user/{operator.pk}/password/", ADMIN_FORM).status_code == 503
    assert _has(operator, PASSWORD)
    assert Token.objects.exists()


def token_for(person):
    expires = timezone.now() + timedelta(days=1)
    return token_make(user=person, name="night", scopes=[Scope.READ], expires_at=expires, actor=person)
