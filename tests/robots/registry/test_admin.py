"""The registry's admin pages for staff."""

from __future__ import annotations

from typing import Any

import pytest
from django.conf import settings
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.site.admin.robots import ReadableJSON
from robots.registry.models import BridgeStatus, Robot, RobotProfile, RobotRole, Role
from robots.registry.services import bridge_status_set, profile_save, robot_save
from robots.shared.processes.one_supervisor import LOCK, only_instance
from robots.shared.sentences import say


@pytest.fixture
def admin(staff: User, signed_in: Any) -> Client:
    client: Client = signed_in(staff)
    return client


def filled(client: Client, url: str, **changes: Any) -> dict[str, Any]:
    """Return the fields of the form at `url` as a browser sends them, with changes."""
    page = client.get(url)
    adminform, formsets = page.context["adminform"], page.context["inline_admin_formsets"]
    forms = [adminform.form]
    for inline in formsets:
        forms += [inline.formset.management_form, *inline.formset.forms]
    sent: dict[str, Any] = {}
    for form in forms:
        for bound in form:
            value = bound.value()
            if value is not None and value is not False:
                sent[bound.html_name] = value
    return sent | changes


def test_the_list_shows_how_each_bridge_fares(admin: Client, robot: Robot) -> None:
    bridge_status_set(robot_id=robot.id, state=BridgeStatus.State.REFUSED, detail="two of them", pid=None)
    with only_instance(settings.FLEET_RUN_DIR / LOCK):
        page = admin.get(reverse("admin:robots_robot_changelist")).content.decode()
    assert "refused to start since" in page and "two of them" in page
    assert "no supervisor is running" not in page
    assert reverse("robot-check", args=[robot.slug]) in page


def test_why_a_bridge_ended_is_said_from_key_and_figures(admin: Client, robot: Robot) -> None:
    why = say(
        "{why}; next start in {wait:g} s", why=say("ended by itself with code {code}", code="7"), wait=2.0
    )
    bridge_status_set(robot_id=robot.id, state=BridgeStatus.State.BACKING_OFF, detail=why, pid=None)
    BridgeStatus.objects.update(detail="")  # the English text
    page = admin.get(reverse("admin:robots_robot_changelist")).content.decode()
    assert "ended by itself with code 7; next start in 2 s" in page


def test_a_killed_supervisors_last_words_are_not_current(admin: Client, robot: Robot) -> None:
    bridge_status_set(robot_id=robot.id, state=BridgeStatus.State.RUNNING, detail="", pid=4711)
    page = admin.get(reverse("admin:robots_robot_changelist")).content.decode()
    assert "no supervisor is running; the last report: running since" in page


def test_an_edit_is_saved_and_recorded_under_the_editors_name(
    admin: Client, robot: Robot, staff: User
) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    answer = admin.post(url, filled(admin, url, advertised_address="10.68.0.2"))
    assert answer.status_code == 302
    robot.refresh_from_db()
    assert robot.advertised_address == "10.68.0.2"
    record = Record.objects.get(kind="robot.change")
    assert record.actor_id == str(staff.pk)
    assert record.parameters["changes"] == [{"field": "advertised_address", "from": "", "to": "10.68.0.2"}]


def test_an_old_form_does_not_put_a_robot_back_into_service(admin: Client, robot: Robot, staff: User) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    left_open = filled(admin, url, name="Another name")
    robot.enabled = False
    robot_save(robot=robot, actor=staff)
    answer = admin.post(url, left_open)
    assert "Sam Staff has saved this entry since you opened it" in answer.content.decode()
    robot.refresh_from_db()
    assert not robot.enabled and robot.name != "Another name"


def test_a_profiles_form_left_open_undoes_nothing_either(
    admin: Client, tiago: RobotProfile, staff: User
) -> None:
    url = reverse("admin:robots_robotprofile_change", args=[tiago.pk])
    left_open = filled(admin, url, name="Another name")
    tiago.blind_mps = 0.1
    profile_save(profile=tiago, actor=staff)
    answer = admin.post(url, left_open)
    assert "Sam Staff has saved this entry since you opened it" in answer.content.decode()
    tiago.refresh_from_db()
    assert (tiago.name, tiago.blind_mps) == ("PAL TIAGo", 0.1)


def test_a_wrong_entry_is_refused_with_its_path(admin: Client, robot: Robot) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    page = admin.post(url, filled(admin, url, overrides='{"limits": {"forward_mps": 9}}')).content.decode()
    assert "limits.forward_mps: 9 is above the profile’s 1" in page
    assert not Record.objects.filter(kind="robot.change").exists()


def test_json_is_shown_in_lines(admin: Client, tiago: RobotProfile) -> None:
    page = admin.get(reverse("admin:robots_robotprofile_change", args=[tiago.pk])).content.decode()
    assert "{\n  &quot;radius_m&quot;: 0.27\n}" in page
    assert ReadableJSON().encode({"a": 1}) == '{\n  "a": 1\n}'


def test_a_robot_is_added_with_its_people(admin: Client, tiago: RobotProfile, stranger: User) -> None:
    url = reverse("admin:robots_robot_add")
    sent = filled(
        admin,
        url,
        **{
            "name": "New", "slug": "new", "profile": tiago.pk, "master_uri": "http://10.0.0.1:11311",
            "roles-TOTAL_FORMS": 1, "roles-0-user": stranger.pk, "roles-0-role": "operator",
        },
    )  # fmt: skip
    answer = admin.post(url, sent)
    assert answer.status_code == 302
    robot = Robot.objects.get(slug="new")
    assert RobotRole.objects.get(robot=robot).user == stranger
    kinds = Record.objects.filter(robot_id=robot.pk).order_by("id").values_list("kind", flat=True)
    assert list(kinds) == ["robot.create", "role.change"]


def test_roles_change_hands_and_go_through_the_robots_page(
    admin: Client, robot: Robot, operator: User, stranger: User
) -> None:
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    new = {"roles-2-TOTAL_FORMS": 1, "roles-2-0-user": stranger.pk, "roles-2-0-role": "operator"}
    assert admin.post(url, filled(admin, url, **new, **{"roles-0-DELETE": "on"})).status_code == 302
    assert list(RobotRole.objects.values_list("user__username", "role")) == [("stranger", "operator")]
    assert admin.post(url, filled(admin, url, **{"roles-0-DELETE": "on"})).status_code == 302
    assert not RobotRole.objects.exists()
    changes = [record.details for record in Record.objects.filter(kind="role.change").order_by("id")]
    assert [(change["name"], change["to"]) for change in changes] == [
        ("Olga Operator", None),
        ("Stig Stranger", "operator"),
        ("Stig Stranger", None),
    ]


def test_roles_are_given_and_taken_in_their_own_list_too(admin: Client, robot: Robot, stranger: User) -> None:
    sent = {"robot": robot.pk, "user": stranger.pk, "role": "observer"}
    assert admin.post(reverse("admin:robots_robotrole_add"), sent).status_code == 302
    role = RobotRole.objects.get()
    assert role.role == Role.OBSERVER
    chosen = {"action": "delete_selected", "_selected_action": [role.pk], "post": "yes"}
    admin.post(reverse("admin:robots_robotrole_changelist"), chosen)
    assert not RobotRole.objects.exists()
    assert Record.objects.filter(kind="role.change").count() == 2


def test_raising_a_blind_speed_warns(admin: Client, tiago: RobotProfile) -> None:
    url = reverse("admin:robots_robotprofile_change", args=[tiago.pk])
    page = admin.post(url, filled(admin, url, blind_mps="0.4"), follow=True).content.decode()
    assert "The blind speed of every PAL TIAGo is now 0.4 m/s (before: 0.3)" in page


def test_an_edited_profile_says_so_and_can_be_taken_back(admin: Client, tiago: RobotProfile) -> None:
    url = reverse("admin:robots_robotprofile_changelist")
    tiago.blind_mps = 0.1
    tiago.save()
    assert "edited here; the shipped one differs" in admin.get(url).content.decode()
    admin.post(url, {"action": "take_shipped", "_selected_action": [tiago.pk]})
    tiago.refresh_from_db()
    assert tiago.blind_mps == 0.3
    assert Record.objects.get(kind="profile.change").parameters["profile"] == "tiago"


def test_robots_and_shipped_profiles_cannot_be_deleted(
    admin: Client, robot: Robot, tiago: RobotProfile
) -> None:
    for name, entry in (("robot", robot), ("robotprofile", tiago)):
        url = reverse(f"admin:robots_{name}_delete", args=[entry.pk])
        assert admin.post(url, {"post": "yes"}).status_code == 403


def test_a_copy_of_a_profile_is_made_here_and_may_go_again(admin: Client, tiago: RobotProfile) -> None:
    url = reverse("admin:robots_robotprofile_change", args=[tiago.pk])
    sent = filled(admin, url, slug="tiago-lab", name="Our TIAGo", _saveasnew="Save as new")
    assert admin.post(url, sent).status_code == 302
    copy = RobotProfile.objects.get(slug="tiago-lab")
    assert copy.topics == tiago.topics
    admin.post(reverse("admin:robots_robotprofile_delete", args=[copy.pk]), {"post": "yes"})
    assert not RobotProfile.objects.filter(slug="tiago-lab").exists()
    kinds = Record.objects.filter(parameters__slug="tiago-lab").order_by("id").values_list("kind", flat=True)
    assert list(kinds) == ["profile.create", "profile.delete"]
