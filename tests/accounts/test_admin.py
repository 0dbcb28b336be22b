"""People and the audit log in the admin."""

import pytest

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.services import record
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

PEOPLE = "/admin/accounts/user/"
SIGN_INS = "/admin/accounts/signin/"
RECORDS = "/admin/audit/record/"


@pytest.fixture
def admin(staff, signed_in):
    """A staff member's browser: staff, not superuser."""
    return signed_in(staff)


@pytest.mark.parametrize("page", [PEOPLE, f"{PEOPLE}add/", SIGN_INS, RECORDS, f"{RECORDS}?kind=stop.press"])
def test_staff_see_the_lists(page, admin):
    record("stop.press")
    assert admin.get(page).status_code == 200


@pytest.mark.parametrize("page", [PEOPLE, SIGN_INS, RECORDS])
def test_other_people_do_not_open_the_admin_page(page, supervisor, signed_in):
    assert signed_in(supervisor).get(page, follow=True).status_code == 403


def test_a_record_can_only_be_read(admin):
    entry = record("stop.press")
    assert admin.get(f"{RECORDS}{entry.pk}/change/").status_code == 200
    assert admin.post(f"{RECORDS}{entry.pk}/change/", {"kind": "stop.clear"}).status_code == 405
    assert admin.get(f"{RECORDS}add/").status_code == 404
    assert admin.post(f"{RECORDS}{entry.pk}/delete/", {"post": "yes"}).status_code == 404
    assert Record.objects.get(pk=entry.pk).kind == "stop.press"


def test_a_new_account_is_recorded_without_its_password(admin, staff):
    form = {
        "username": "new",
        "full_name": "Nia New",
        "usable_password": "true",
        "password1": PASSWORD,
        "password2": PASSWORD,
    }
    assert admin.post(f"{PEOPLE}add/", form).status_code == 302
    entry = Record.objects.get(kind="account.create", content__data__name="Nia New")
    assert entry.actor_id == str(staff.pk)
    assert PASSWORD not in str(entry.details)


def test_the_help_of_a_new_password_can_be_translated(admin, operator):
    page = admin.get(f"{PEOPLE}{operator.pk}/password/").content.decode()
    assert "the present password is lost" in page
    assert "If disabled, the current password" not in page  # of Django, in English in every language


def test_making_a_person_staff_is_recorded(admin, operator):
    form = {
        "username": "operator",
        "full_name": "Olga Operator",
        "email": "",
        "is_active": "on",
        "is_staff": "on",
    }
    assert admin.post(f"{PEOPLE}{operator.pk}/change/", form).status_code == 302
    assert User.objects.get(pk=operator.pk).is_staff
    changes = Record.objects.get(kind="account.change").details["changes"]
    assert changes == [{"field": "is_staff", "from": False, "to": True}]


def test_a_new_password_is_recorded_without_its_text(admin, operator):
    form = {"usable_password": "true", "password1": "another long walk", "password2": "another long walk"}
    assert admin.post(f"{PEOPLE}{operator.pk}/password/", form).status_code == 302
    changes = Record.objects.get(kind="account.change").details["changes"]
    assert changes == [{"field": "password"}]


def test_a_persons_page_leads_to_their_roles(admin, operator):
    page = admin.get(f"{PEOPLE}{operator.pk}/change/").content.decode()
    assert f"/admin/robots/robotrole/?user__id__exact={operator.pk}" in page


def test_accounts_are_closed_not_deleted(admin, operator):
    assert admin.post(f"{PEOPLE}{operator.pk}/delete/", {"post": "yes"}).status_code == 403


def test_sign_ins_are_to_be_read_only(admin, staff):
    sign_in = staff.sign_ins.get()
    assert admin.get(f"{SIGN_INS}{sign_in.pk}/change/").status_code == 200
    assert admin.post(f"{SIGN_INS}{sign_in.pk}/delete/", {"post": "yes"}).status_code == 403
    assert sign_in.session_id not in admin.get(f"{SIGN_INS}{sign_in.pk}/change/").content.decode()


@pytest.mark.parametrize(
    "page_and_lookup",
    [
        f"{SIGN_INS}?session__session_key__startswith=",
        f"{SIGN_INS}?session_id__startswith=",
        f"{SIGN_INS}?session__startswith=",
        f"{SIGN_INS}?auth_hash__startswith=",
        f"{SIGN_INS}?user__password__startswith=",
        f"{PEOPLE}?sign_ins__session__session_key__startswith=",
        f"{PEOPLE}?sign_ins__auth_hash__startswith=",
        f"{PEOPLE}?password__startswith=",
        "/admin/robots/robotrole/?user__password__startswith=",
        "/admin/robots/robotrole/?user__sign_ins__session__session_key__startswith=",
    ],
)
def test_a_list_cannot_be_asked_for_keys_character_by_character(page_and_lookup, admin, operator, signed_in):
    signed_in(operator)
    assert admin.get(f"{page_and_lookup}a").status_code == 400


def test_every_offered_filter_works(admin, operator):
    response = admin.get(f"{PEOPLE}?is_staff__exact=0")
    assert [person.pk for person in response.context["cl"].result_list] == [operator.pk]
