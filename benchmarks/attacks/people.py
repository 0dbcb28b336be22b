"""``python -m benchmarks.attacks.people``: accounts, sessions and tokens for floods of stops, in the database.

It prints one JSON object: Cookie headers and tokens of people who see no robot (`strangers`), of people who may stop
all robots (`colleagues`), and of one more of these who does not flood (`presser`). Nothing is hashed.
"""

from __future__ import annotations

import json
import os
from datetime import timedelta

import django
from django.conf import settings
from django.test import Client
from django.utils import timezone

PEOPLE = 10  # of each kind


def main() -> None:
    """Make the accounts and print what they sign in with."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "fleet.settings")
    django.setup()
    print(json.dumps(crowd()))


def crowd() -> dict[str, list[dict[str, str]]]:
    """Make the accounts; return `cookie`, `csrf` and `token` of each."""
    made = {kind: [_one(kind, number) for number in range(PEOPLE)] for kind in ("strangers", "colleagues")}
    return {**made, "presser": [_one("presser", 0)]}


def _one(kind: str, number: int) -> dict[str, str]:
    from fleet.accounts.models import User
    from fleet.accounts.tokens.models import Scope
    from fleet.accounts.tokens.services import token_make
    from robots.registry.models import Robot, RobotRole, Role

    person = User(username=f"{kind}-{number}", full_name=f"{kind} {number}")
    person.set_unusable_password()
    person.save()
    if kind != "strangers":
        for robot in Robot.objects.all():
            RobotRole.objects.create(user=person, robot=robot, role=Role.OBSERVER)
    browser = Client(HTTP_HOST=settings.ALLOWED_HOSTS[0])
    browser.force_login(person)
    browser.get("/accounts/")  # sets the CSRF cookie
    cookies = {name: morsel.value for name, morsel in browser.cookies.items()}
    csrf = next(value for name, value in cookies.items() if name.startswith("fleet_csrf"))
    until = timezone.now() + timedelta(days=1)
    _, token = token_make(user=person, name="flood", scopes=[Scope.READ], expires_at=until, actor=person)
    return {
        "cookie": "; ".join(f"{name}={value}" for name, value in cookies.items()),
        "csrf": csrf,
        "token": token,
    }


if __name__ == "__main__":
    main()
