"""The admin writes no separate log: people's names would stay there for ever."""

import pytest
from django.contrib import admin
from django.contrib.admin.models import LogEntry
from django.urls import reverse

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.audit.recorded_admin import RecordedAdmin
from robots.registry.models import RobotRole

pytestmark = pytest.mark.django_db


def test_every_page_of_the_admin_is_of_those_that_keep_no_log():
    assert [page for page in admin.site._registry.values() if not isinstance(page, RecordedAdmin)] == []


def test_admin_changes_are_in_the_audit_log_alone(staff, robot, operator, signed_in):
    client = signed_in(staff)
    person = {"username": "olga", "full_name": "Olga New", "usable_password": "false"}
    assert client.post(reverse("admin:accounts_user_add"), person).status_code == 302
    olga = User.objects.get(username="olga")
    change = reverse("admin:accounts_user_change", args=[olga.pk])
    assert client.post(change, person | {"full_name": "Olga Newer", "is_active": "on"}).status_code == 302
    role = RobotRole.objects.get(robot=robot, user=operator)
    delete = reverse("admin:robots_robotrole_delete", args=[role.pk])
    assert client.post(delete, {"post": "yes"}).status_code == 302
    kinds = Record.objects.filter(actor=str(staff.pk)).values_list("kind", flat=True)
    assert {"account.create", "account.change", "role.change"} <= set(kinds)
    assert not LogEntry.objects.exists()


def test_only_the_audit_log_has_history(staff, signed_in):
    client = signed_in(staff)
    history = reverse("admin:accounts_user_history", args=[staff.pk])
    assert client.get(history).headers["Location"] == reverse("admin:audit_record_changelist")
    assert history not in client.get(reverse("admin:accounts_user_change", args=[staff.pk])).content.decode()
    assert "Recent actions" not in client.get(reverse("admin:index")).content.decode()
