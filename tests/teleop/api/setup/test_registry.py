"""Staff register robots by REST, as in the admin."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.audit.models import Record
from robots.registry.models import Robot

pytestmark = pytest.mark.django_db(transaction=True)


def headers_of(person: User) -> dict[str, str]:
    expires = timezone.now() + timedelta(days=1)
    _, text = token_make(user=person, name="x", scopes=list(Scope), expires_at=expires, actor=person)
    return {"Authorization": f"Bearer {text}"}


def ask(method: str, path: str, headers: dict[str, str], body: Any = None, **more: str) -> Any:
    call = getattr(Client(), method)
    return call(f"/api/v1{path}", body, content_type="application/json", headers={**headers, **more})


def test_staff_register_and_change_a_robot(robot: Robot, staff: User, supervisor: User) -> None:
    mine = headers_of(staff)
    asked = {"name": "TIAGo 9", "profile": robot.profile.slug, "master_uri": "http://tiago-9c:11311"}
    assert ask("post", "/registry", headers_of(supervisor), asked).json()["code"] == "permission_denied"
    wrong = ask("post", "/registry", mine, {**asked, "master_uri": "tiago"})
    assert (wrong.status_code, "master_uri" in wrong.json()["detail"]) == (400, True)
    made = ask("post", "/registry", mine, asked)
    assert (made.status_code, made.json()["slug"]) == (201, "tiago-9"), made.content
    path = "/registry/tiago-9"
    assert ask("patch", path, mine, {"enabled": False}).status_code == 428
    seen = ask("get", path, mine)["ETag"]
    changed = ask("patch", path, mine, {"max_share": 0.4}, **{"If-Match": seen})
    assert (changed.status_code, changed.json()["max_share"]) == (200, 0.4)
    assert ask("patch", path, mine, {"enabled": False}, **{"If-Match": seen}).status_code == 412
    assert Robot.objects.get(slug="tiago-9").enabled
    kinds = Record.objects.filter(actor_id=str(staff.pk)).order_by("pk").values_list("kind", flat=True)
    assert [kind for kind in kinds if kind.startswith("robot.")] == ["robot.create", "robot.change"]
    listed = ask("get", "/profiles", mine).json()["profiles"]
    assert robot.profile.slug in [one["slug"] for one in listed]
