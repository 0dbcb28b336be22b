"""Set-up by REST instead of pages: the same rules, the same records."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.bookings.models import Booking
from robots.access.models import Course, Qualification, RobotGroup
from robots.access.selectors import lab_date, role_on
from robots.registry.models import Robot, RobotProfile, Role
from teleop.webhooks.events import EVENT_CATEGORIES
from tests.teleop.api.conftest import Caller

Program = Callable[..., Any]


@pytest.fixture
def other(tiago: RobotProfile) -> Robot:
    return Robot.objects.create(slug="other", name="Other", profile=tiago, master_uri="http://10.0.0.9:11311")


def kinds_of(person: User) -> set[str]:
    return set(Record.objects.filter(actor_id=str(person.pk)).values_list("kind", flat=True))


# --- policies, out of service, series ---------------------------------------------------------------


def test_a_supervisor_sets_and_removes_a_robots_policy(
    program: Program, supervisor: User, operator: User, robot: Robot
) -> None:
    ask, path = program(supervisor), f"/policies/robots/{robot.slug}"
    read = ask("GET", path)
    assert (read.data["own"], read.data["rules"]["opening"]) == (False, {})
    rules = {**read.data["rules"], "opening": {"mon": [["08:00", "20:00"]]}, "longest_min": 90}
    assert ask("PUT", path, rules).data["code"] == "if_match_missing"
    made = ask("PUT", path, rules, If_Match=read["ETag"])
    assert (made.status_code, made.data["own"], made.data["rules"]) == (200, True, rules)
    late = ask("PUT", path, rules | {"longest_min": 60}, If_Match=read["ETag"])
    assert (late.status_code, late.data["code"]) == (412, "changed")
    for wrong in ({"opening": {"mon": [["20:00", "08:00"]]}}, {"shortest_min": 120}):
        refused = ask("PUT", path, rules | wrong, If_Match=made["ETag"])
        assert (refused.status_code, refused.data["code"]) == (400, "invalid"), wrong
    assert program(operator)("PUT", path, rules, If_Match=made["ETag"]).status_code == 403
    listed = program(operator)("GET", "/policies").data["policies"]
    assert [one["rules"]["longest_min"] for one in listed if one["robot"] == robot.slug] == [90]
    assert ask("DELETE", path).status_code == 204
    assert not ask("GET", path).data["own"]
    assert {"policy.change", "policy.remove"} <= kinds_of(supervisor)


def test_staff_set_the_policies_of_a_group_and_of_all(
    program: Program, staff: User, supervisor: User, robot: Robot, other: Robot
) -> None:
    group = RobotGroup.objects.create(name="Arms", slug="arms")
    group.robots.set([robot, other])
    ask, bound = program(staff), program(staff, robots=[robot])
    for path in ("/policies/all", "/policies/groups/arms"):
        read = ask("GET", path)
        rules = read.data["rules"] | {"horizon_days": 3}
        assert program(supervisor)("PUT", path, rules, If_Match=read["ETag"]).status_code == 403
        assert bound("PUT", path, rules, If_Match=read["ETag"]).data["code"] == "other_robots"
        assert ask("PUT", path, rules, If_Match=read["ETag"]).status_code == 200
    followed = ask("GET", f"/policies/robots/{robot.slug}").data
    assert (followed["own"], followed["rules"]["horizon_days"]) == (False, 3)
    assert ask("DELETE", "/policies/groups/arms").status_code == 204


def test_a_robot_is_taken_out_of_service_and_back(
    program: Program, supervisor: User, operator: User, robot: Robot
) -> None:
    starts = timezone.now().replace(minute=0, second=0, microsecond=0) + timedelta(days=1)
    slot = {
        "robot": robot.slug,
        "starts_at": starts.isoformat(),
        "ends_at": (starts + timedelta(hours=1)).isoformat(),
    }
    booked = program(operator)("POST", "/bookings", slot).data["id"]
    asked = {"robot": robot.slug, "why": "repair", "note": "left wheel"}
    assert program(operator)("POST", "/out-of-service", asked).status_code == 403
    ask = program(supervisor)
    backwards = {**asked, "ends_at": "2026-01-01T00:00:00Z"}
    assert ask("POST", "/out-of-service", backwards).data["code"] == "invalid"
    refused = ask("POST", "/out-of-service", asked)
    assert (refused.status_code, refused.data["code"]) == (409, "takes_time")
    assert [(one["booking"], one["how"]) for one in refused.data["losses"]] == [(booked, "useless")]
    assert program(operator)("GET", "/out-of-service").data["periods"] == []
    assert ask("POST", "/out-of-service?preview=yes&confirm=yes", asked).data["code"] == "preview"
    made = ask("POST", "/out-of-service?confirm=yes", asked)
    assert (made.status_code, made.data["affected"]) == (201, [booked]), made.data
    listed = program(operator)("GET", "/out-of-service").data["periods"]
    assert [one["id"] for one in listed] == [made.data["id"]]
    later = {
        "robot": robot.slug,
        "starts_at": slot["ends_at"],
        "ends_at": (starts + timedelta(hours=2)).isoformat(),
    }
    assert program(operator)("POST", "/bookings", later).data["code"] == "out_of_service"
    assert ask("DELETE", f"/out-of-service/{made.data['id']}").status_code == 204
    assert program(operator)("POST", "/bookings", later).status_code == 201
    assert {"robot.out_of_service", "robot.back_in_service"} <= kinds_of(supervisor)


def test_a_change_that_takes_time_is_confirmed_and_undone(
    program: Program, supervisor: User, operator: User, robot: Robot
) -> None:
    starts = timezone.now().replace(hour=12) + timedelta(days=1)
    times = {"starts_at": starts.isoformat(), "ends_at": (starts + timedelta(hours=1)).isoformat()}
    student, ask = program(operator), program(supervisor)
    booked = student("POST", "/bookings", {"robot": robot.slug, **times}).data["id"]
    path = f"/policies/robots/{robot.slug}"
    read = ask("GET", path)
    closed = {**read.data["rules"], "opening": {"sun": [["01:00", "01:05"]]}}

    def put(query: str = "", rules: dict[str, Any] = closed) -> Any:
        return ask("PUT", f"{path}{query}", rules, If_Match=ask("GET", path)["ETag"])

    def stage() -> str:
        return str(student("GET", f"/bookings/{booked}").data["stage"])

    refused = put()
    assert (refused.status_code, refused.data["code"]) == (409, "takes_time")
    assert [(one["username"], one["how"]) for one in refused.data["losses"]] == [("operator", "closed")]
    assert not ask("GET", path).data["own"]
    assert (put("?confirm=keep_closed").status_code, stage()) == (200, "booked")
    assert ask("GET", "/changes").data["changes"] == []  # it took nothing
    assert put(rules=read.data["rules"]).status_code == 200
    assert (put("?confirm=yes").status_code, stage()) == (200, "cancelled")
    [change] = ask("GET", "/changes").data["changes"]
    assert (change["undoable"], [one["booking"] for one in change["losses"]]) == (True, [booked])
    assert program(operator)("POST", f"/changes/{change['id']}/undo").status_code == 404
    undone = ask("POST", f"/changes/{change['id']}/undo")
    assert (undone.data["back"], undone.data["lost"], stage()) == ([booked], [], "booked")
    again = ask("POST", f"/changes/{change['id']}/undo")
    assert (again.status_code, again.data["code"]) == (409, "undone")


def test_a_weekly_series_is_previewed_and_booked(
    program: Program, supervisor: User, operator: User, robot: Robot
) -> None:
    first = (timezone.now() + timedelta(days=2)).replace(hour=10, minute=0, second=0, microsecond=0)
    asked = {
        "robot": robot.slug,
        "starts_at": first.isoformat(),
        "ends_at": (first + timedelta(hours=1)).isoformat(),
        "weeks": 3,
        "without": [f"{first + timedelta(days=7):%Y-%m-%d}"],
        "zone": "UTC",
        "purpose": "Lab course",
        "record": True,
    }
    assert program(operator)("POST", "/bookings/series", asked).data["code"] == "permission_denied"
    ask = program(supervisor)
    assert ask("POST", "/bookings/series", asked | {"zone": "Mars/Base"}).data["code"] == "invalid"
    shown = ask("POST", "/bookings/series", asked | {"preview": True}).data
    assert (shown["series"], [week["booking"] for week in shown["weeks"]]) == (None, [None, None])
    assert not Booking.objects.exists()
    made = ask("POST", "/bookings/series", asked).data
    stored = Booking.objects.order_by("starts_at")
    assert [str(one.pk) for one in stored] == [week["booking"] for week in made["weeks"]]
    assert {str(one.series) for one in stored} == {made["series"]}
    assert [one.starts_at for one in stored] == [first, first + timedelta(days=14)]
    assert [one.record for one in stored] == [True, True]
    again = ask("POST", "/bookings/series", asked).data
    assert [week["refusals"][0]["code"] for week in again["weeks"]] == ["taken", "taken"]
    address = f"/bookings/series/{made['series']}"
    assert [week["booking"] for week in ask("GET", address).data["weeks"]] == [str(one.pk) for one in stored]
    seen = ask("PATCH", address, {"begins": "14:00", "minutes": 90, "preview": True}).data["weeks"]
    assert [week["starts_at"][11:16] for week in seen] == ["14:00", "14:00"]
    assert stored.first().starts_at == first
    ask("PATCH", address, {"begins": "14:00", "minutes": 90})
    assert [one.starts_at.hour for one in stored.all()] == [14, 14]
    since = f"{first + timedelta(days=7):%Y-%m-%d}"
    assert len(ask("DELETE", f"{address}?since={since}").data["weeks"]) == 1
    assert [one.state for one in stored.all()] == ["booked", "cancelled"]
    assert program(operator)("GET", address).status_code == 404


# --- courses, invitations, groups, qualifications ---------------------------------------------------


def test_staff_make_change_and_archive_a_course(
    program: Program, staff: User, supervisor: User, operator: User, robot: Robot
) -> None:
    today, ask = lab_date(), program(staff)
    asked = {
        "name": "Robotics lab",
        "robots": [robot.slug],
        "starts_on": f"{today}",
        "ends_on": f"{today + timedelta(days=90)}",
        "supervisors": [supervisor.username],
        "quotas": {"week_min": 120},
    }
    assert program(supervisor)("POST", "/courses", asked).status_code == 403
    assert ask("POST", "/courses", asked | {"robots": []}).data["code"] == "robot_needed"
    made = ask("POST", "/courses", asked)
    assert (made.status_code, made.data["quotas"]["week_min"]) == (201, 120), made.data
    path = made["Location"].removeprefix("/api/v1")
    assert ask("POST", "/courses", asked).data["code"] == "invalid"  # its name is taken
    changed = ask("PATCH", path, {"role": "observer"}, If_Match=made["ETag"])
    assert (changed.status_code, changed.data["role"], changed.data["robots"]) == (
        200,
        "observer",
        [robot.slug],
    )
    assert ask("PATCH", path, {"role": "operator"}, If_Match=made["ETag"]).status_code == 412
    archived = ask("PATCH", path, {"archived": True}, If_Match=changed["ETag"])
    assert archived.data["archived"]
    assert not Course.objects.get().supervisors.exclude(pk=supervisor.pk).exists()
    assert {"course.create", "course.change", "course.archive"} <= kinds_of(staff)


def test_an_invitation_is_made_used_and_revoked(
    program: Program, staff: User, stranger: User, robot: Robot, signed_in: Callable[..., Any]
) -> None:
    course = Course.objects.create(
        name="Lab", slug="lab", starts_on=lab_date(), ends_on=lab_date() + timedelta(days=9)
    )
    course.robots.add(robot)
    ask, path = program(staff), "/courses/lab/invitations"
    assert ask("POST", path, {"last_day": f"{lab_date() - timedelta(days=1)}"}).data["code"] == "invalid"
    made = ask("POST", path, {"last_day": f"{lab_date()}", "most_uses": 2})
    assert (made.status_code, made.data["refusal"]) == (201, None)
    assert signed_in(stranger).post(made.data["link"].partition("testserver")[2]).status_code == 302
    assert role_on(stranger, robot) == Role.OPERATOR
    assert ask("GET", path).data["invitations"][0]["uses"] == 1
    assert ask("DELETE", f"{path}/{made.data['id']}").status_code == 204
    assert ask("GET", path).data["invitations"][0]["refusal"]["code"] == "invitation_revoked"


def test_people_without_password_get_their_e_mail_again(
    program: Program, staff: User, robot: Robot, mailoutbox: list[Any]
) -> None:
    course = Course.objects.create(
        name="Lab", slug="lab", starts_on=lab_date(), ends_on=lab_date() + timedelta(days=9)
    )
    course.robots.add(robot)
    ask = program(staff)
    ask("POST", "/courses/lab/members", {"list": "Ada Lovelace <ada@example.org>"})
    before = len(mailoutbox)
    assert ask("POST", "/courses/lab/welcome", {"people": None}).data == {"people": 1}
    assert ask("POST", "/courses/lab/welcome", {"people": ["nobody"]}).status_code == 404
    assert before <= len(mailoutbox)


def test_staff_set_up_groups_roles_and_qualifications(
    program: Program, staff: User, supervisor: User, stranger: User, robot: Robot, other: Robot
) -> None:
    ask, bound = program(staff), program(staff, robots=[robot])
    assert program(supervisor)("GET", "/robot-groups").status_code == 403
    made = ask("POST", "/robot-groups", {"name": "Arms", "robots": [robot.slug, "other"]})
    assert made.status_code == 201, made.data
    assert bound("GET", "/robot-groups").data["groups"] == []
    assert bound("DELETE", "/robot-groups/arms").data["code"] == "other_robots"
    path = f"/robot-groups/arms/roles/{stranger.username}"
    assert ask("PUT", path, {"role": "operator"}).status_code == 200
    assert role_on(stranger, other) == Role.OPERATOR
    assert ask("PUT", path.replace(stranger.username, "nobody"), {"role": "operator"}).status_code == 404
    read = ask("GET", "/robot-groups/arms")
    assert read.data["roles"] == [{"username": stranger.username, "role": "operator"}]
    changed = ask("PUT", "/robot-groups/arms", {"name": "Arms", "robots": ["other"]}, If_Match=read["ETag"])
    assert changed.data["robots"] == ["other"]
    demanded = {"name": "Induction", "groups": ["arms"], "description": "Room 2"}
    made = ask("POST", "/qualifications", demanded)
    assert made.data["groups"] == ["arms"], made.data
    assert ask("PUT", "/qualifications/induction", demanded, If_Match='"1"').status_code == 412
    assert bound("GET", "/qualifications/induction").status_code == 403
    assert ask("DELETE", path).status_code == 204
    assert role_on(stranger, other) is None
    assert ask("DELETE", "/qualifications/induction").status_code == 204
    assert ask("DELETE", "/robot-groups/arms").status_code == 204
    assert not RobotGroup.objects.exists()
    assert not Qualification.objects.exists()


def test_staff_give_a_role_on_one_robot(
    program: Program, staff: User, supervisor: User, stranger: User, robot: Robot
) -> None:
    path = f"/registry/{robot.slug}/roles/{stranger.username}"
    assert program(supervisor)("PUT", path, {"role": "operator"}).status_code == 403
    assert program(staff)("PUT", path, {"role": "operator"}).status_code == 200
    assert role_on(stranger, robot) == Role.OPERATOR
    assert program(staff)("DELETE", path).status_code == 204
    assert role_on(stranger, robot) is None


# --- profiles and phrases ---------------------------------------------------------------------------


def test_profiles_are_read_by_all_and_changed_by_staff(
    program: Program, staff: User, observer: User, robot: Robot
) -> None:
    path, ask = f"/profiles/{robot.profile.slug}", program(staff)
    read = program(observer)("GET", path)
    assert read.data["topics"]["odometry"], read.data
    change = {"forward_mps": 0.5}
    assert program(observer)("PATCH", path, change, If_Match=read["ETag"]).status_code == 403
    wrong = ask("PATCH", path, {"forward_mps": 99.0}, If_Match=read["ETag"])
    assert (wrong.status_code, "forward_mps" in wrong.data["detail"]) == (400, True)
    changed = ask("PATCH", path, change, If_Match=read["ETag"])
    assert (changed.status_code, changed.data["forward_mps"]) == (200, 0.5), changed.data
    assert ask("PATCH", path, change, If_Match=read["ETag"]).status_code == 412
    assert "profile.change" in kinds_of(staff)


def test_staff_replace_the_phrases_of_profile_and_robot(
    program: Program, staff: User, observer: User, robot: Robot
) -> None:
    ask = program(staff)
    for path in (f"/profiles/{robot.profile.slug}/phrases", f"/registry/{robot.slug}/phrases"):
        read = program(observer)("GET", path)
        phrases = [{"text": f"From {path}", "language": "en-gb", "tags": ["lab"]}]
        assert program(observer)("PUT", path, {"phrases": phrases}, If_Match=read["ETag"]).status_code == 403
        wrong = ask(
            "PUT", path, {"phrases": [{"text": "two\nlines", "language": "en-GB"}]}, If_Match=read["ETag"]
        )
        assert wrong.data["figures"] == {"phrase": 1}
        made = ask("PUT", path, {"phrases": phrases}, If_Match=read["ETag"])
        assert made.data["phrases"][0]["language"] == "en-GB", made.data
    listed = program(observer)("GET", f"/robots/{robot.slug}/phrases").data["phrases"]
    assert len(listed) == 2


# --- webhooks ---------------------------------------------------------------------------------------


def test_staff_make_pause_and_delete_a_webhook(
    program: Program, staff: User, supervisor: User, robot: Robot, other: Robot
) -> None:
    ask, bound = program(staff), program(staff, robots=[robot])
    asked = {
        "name": "ci",
        "address": "https://hooks.example.org/lab",
        "kinds": list(EVENT_CATEGORIES),
        "robots": [robot.slug],
    }
    assert program(supervisor)("POST", "/webhooks", asked).status_code == 403
    assert bound("POST", "/webhooks", asked | {"robots": []}).data["code"] == "other_robots"
    made = bound("POST", "/webhooks", asked)
    assert (made.status_code, made.data["secret"][:6]) == (201, "whsec_"), made.data
    assert made["Cache-Control"] == "no-store"
    path = made["Location"].removeprefix("/api/v1")
    assert "secret" not in ask("GET", path).data
    assert ask("POST", "/webhooks", asked).data["code"] == "name_taken"
    assert ask("POST", f"{path}/test").status_code == 204
    [sent] = ask("GET", f"{path}/deliveries").data["deliveries"]
    assert (sent["type"], sent["state"], sent["record"]) == ("webhook.test", "waiting", None)
    assert not ask("PATCH", path, {"paused": True}).data["sends"]
    assert ask("POST", f"{path}/test").data["code"] == "paused"
    assert ask("PATCH", path, {"paused": False}).data["sends"]
    assert ask("POST", f"{path}/again").data == {"deliveries": 0}
    assert program(staff, robots=[other])("GET", path).status_code == 404
    assert ask("DELETE", path).status_code == 204
    assert ask("GET", "/webhooks").data == {"webhooks": []}


# --- tokens -----------------------------------------------------------------------------------------


def as_program(text: str) -> Any:
    return Caller(Client(), {"Authorization": f"Bearer {text}"})


def test_a_token_makes_none_that_could_do_more(
    program: Program, operator: User, robot: Robot, other: Robot
) -> None:
    own = program(operator, "read", "manage", robots=[robot])
    far = (timezone.now() + timedelta(days=200)).isoformat()
    wrong = {"name": "more", "scopes": ["read", "drive"], "robots": ["other"], "expires_at": far}
    assert own("POST", "/tokens", wrong).status_code == 404  # a robot that the operator may not see
    wrong["robots"] = [robot.slug]
    refused = own("POST", "/tokens", wrong)
    assert (refused.status_code, refused.data["code"]) == (403, "more_than_own")
    assert [one["figures"]["field"] for one in refused.data["refusals"]] == ["scopes", "expires_at"]
    assert program(operator, "read")("POST", "/tokens", wrong).data["code"] == "scope_missing"
    made = own("POST", "/tokens", {"name": "less", "scopes": ["read"]})
    assert (made.status_code, made.data["robots"]) == (201, [robot.slug]), made.data
    assert made["Cache-Control"] == "no-store"
    child = as_program(made.data["token"])
    assert [one["slug"] for one in child("GET", "/robots").data["robots"]] == [robot.slug]
    assert child("POST", "/tokens", {"name": "x", "scopes": ["read"]}).data["figures"]["scope"] == "manage"
    assert own("POST", "/tokens", {"name": "less", "scopes": ["read"]}).data["code"] == "name_taken"
    assert own("POST", "/tokens", {"name": "  ", "scopes": ["read"]}).data["code"] == "name_unseen"


def test_a_token_that_ends_takes_those_it_made_along(program: Program, operator: User) -> None:
    own = program(operator)
    child = own("POST", "/tokens", {"name": "child", "scopes": ["read", "manage"]}).data
    grandchild = as_program(child["token"])("POST", "/tokens", {"name": "next", "scopes": ["read"]}).data
    assert grandchild["made_with"] == child["id"]
    listed = {one["name"]: one["current"] for one in own("GET", "/tokens").data["tokens"]}
    assert listed == {"night-tests": True, "child": False, "next": False}
    reader = as_program(grandchild["token"])
    assert reader("DELETE", f"/tokens/{child['id']}").data["code"] == "scope_missing"
    assert own("DELETE", f"/tokens/{child['id']}").status_code == 204
    assert reader("GET", "/robots").data["code"] == "token_invalid"
    assert Record.objects.filter(kind="token.end").count() == 2


def test_a_token_bound_to_robots_sets_up_nothing_beyond_them(
    program: Program, staff: User, robot: Robot, other: Robot
) -> None:
    bound, wide = program(staff, robots=[robot]), program(staff)
    RobotGroup.objects.create(name="Empty", slug="empty")
    asked = {"name": "New", "profile": robot.profile.slug, "master_uri": "http://10.0.0.5:11311"}
    read = bound("GET", f"/registry/{robot.slug}")
    [token] = [one for one in wide("GET", "/tokens").data["tokens"] if one["robots"] is None]
    for method, path, body in [
        ("POST", "/registry", asked),
        (
            "PATCH",
            f"/registry/{robot.slug}",
            {"master_uri": other.master_uri},
        ),  # this robot would become the other one
        ("POST", "/robot-groups", {"name": "Later"}),  # robots may be added to the group later
        ("PUT", "/robot-groups/empty/roles/staff", {"role": "operator"}),
        ("GET", "/policies/groups/empty", None),
        ("POST", "/qualifications", {"name": "Later"}),
        ("POST", "/qualifications", {"name": "Later", "robots": [robot.slug], "groups": ["empty"]}),
        ("DELETE", f"/tokens/{token['id']}", None),
    ]:
        refused = bound(method, path, body, If_Match=read["ETag"])
        found = (refused.status_code, refused.data["code"], refused.data["rule"])
        assert found == (403, "other_robots", "account"), (method, path, refused.data)
    assert not Robot.objects.filter(name="New").exists()
    assert (
        bound("PATCH", f"/registry/{robot.slug}", {"enabled": False}, If_Match=read["ETag"]).status_code
        == 200
    )


def test_a_token_whose_robots_are_gone_makes_none_for_all(
    program: Program, staff: User, other: Robot
) -> None:
    own = program(staff, robots=[other])
    other.delete()
    refused = own("POST", "/tokens", {"name": "more", "scopes": ["read"]})
    assert (refused.status_code, refused.data["code"]) == (403, "other_robots")


def test_a_webhook_brings_a_token_no_news_that_it_may_not_read(
    program: Program, staff: User, robot: Robot
) -> None:
    asked = {
        "name": "ci",
        "address": "https://hooks.example.org/lab",
        "kinds": list(EVENT_CATEGORIES),
        "robots": [robot.slug],
    }
    refused = program(staff, "manage")("POST", "/webhooks", asked)
    assert (refused.data["code"], refused.data["figures"]) == ("scope_missing", {"scope": "read"})
    assert program(staff, "manage", "read")("POST", "/webhooks", asked).status_code == 201


def test_a_token_ends_itself_and_no_other_persons(program: Program, operator: User, observer: User) -> None:
    reader, stranger = program(operator, "read"), program(observer)
    [own] = reader("GET", "/tokens").data["tokens"]
    assert stranger("DELETE", f"/tokens/{own['id']}").status_code == 404
    assert reader("DELETE", f"/tokens/{own['id']}").status_code == 204
    assert reader("GET", "/tokens").status_code == 401


def test_a_browser_makes_tokens_only_after_a_fresh_password(page_of: Program, operator: User) -> None:
    refused = page_of(operator)("POST", "/tokens", {"name": "x", "scopes": ["read"]})
    assert (refused.status_code, refused.data["code"]) == (403, "password_needed")


def test_staff_make_service_accounts_and_their_tokens(
    program: Program, staff: User, supervisor: User, operator: User
) -> None:
    ask = program(staff)
    asked = {"name": "Night tests", "project": "Grasping"}
    assert program(supervisor)("POST", "/service-accounts", asked).status_code == 403
    made = ask("POST", "/service-accounts", asked)
    assert (made.status_code, made.data["username"]) == (201, "night-tests"), made.data
    path = "/service-accounts/night-tests/tokens"
    token = ask("POST", path, {"name": "ci", "scopes": ["read"]})
    assert token.status_code == 201, token.data
    assert as_program(token.data["token"])("GET", "/robots").data == {"robots": []}
    assert ask("POST", path.replace("night-tests", operator.username), asked).status_code in (400, 404)
    [listed] = ask("GET", "/service-accounts").data["accounts"]
    assert (listed["tokens"], listed["active"]) == (1, True)
    used = datetime.fromisoformat(listed["used_at"].replace("Z", "+00:00"))
    assert used.tzinfo == UTC
    assert ask("GET", path).data["tokens"][0]["made_with"]
