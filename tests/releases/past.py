"""Run by the code of any release: `past.py seed` fills its database, `past.py facts` prints what is in it.

It uses the little that all releases share.
"""

# ruff: noqa: E402

import json
import sys

import django

django.setup()

from django.apps import apps
from django.contrib.auth import get_user_model
from django.utils import timezone

try:
    from fleet.audit.services import record
except ImportError:  # 2026-11-22
    from fleet.audit import record

PEOPLE = {"ada": "Ada@Lab.example", "bob": "", "sam": "sam@lab.example"}
PASSWORD = "a long walk on the beach"


def model(label):
    return apps.get_model(label)


def seed():
    users = get_user_model().objects
    ada, bob, _sam = [
        users.create_user(
            name, password=PASSWORD, email=email, full_name=name.title(), is_staff=name == "sam"
        )
        for name, email in PEOPLE.items()
    ]
    profile = model("robots.RobotProfile").objects.get(slug="tiago")
    robot = model("robots.Robot").objects.create(
        slug="tiago-7", name="TIAGo Seven", profile=profile, master_uri="http://127.0.0.1:9"
    )
    for person, role in ((ada, "operator"), (bob, "observer")):
        model("robots.RobotRole").objects.create(robot=robot, user=person, role=role)
    for text, language in (("Bona tarda a tothom.", "ca"), ("Mind the step.", "en-GB")):
        model("robots.Phrase").objects.create(robot=robot, text=text, language=language)
    where = {"actor": ada, "robot_id": robot.id, "robot_name": robot.name}
    for fence in (1, 2):
        now = timezone.now()
        session = model("teleop.ControlSession").objects.create(
            robot=robot, user=ada, fence=fence, started_at=now, ended_at=now, end_reason="released"
        )
        of = {**where, "session_id": session.pk, "fence": fence}
        record("control.take", **of)
        said = record("speech.start", **of, text=f"Hello, {fence}.", parameters={"language": "en-GB"})
        record("speech.end", of=said, outcome="succeeded")
        record("control.end", **of, outcome="released")


def facts():
    users = get_user_model().objects
    sessions = model("teleop.ControlSession").objects
    records = model("audit.Record").objects
    return {
        "people": sorted(
            [user.username, user.full_name, user.email.lower(), user.check_password(PASSWORD)]
            for user in users.all()
        ),
        "robots": sorted(
            map(list, model("robots.Robot").objects.values_list("slug", "name", "profile__slug"))
        ),
        "roles": sorted(
            map(list, model("robots.RobotRole").objects.values_list("robot__slug", "user__username", "role"))
        ),
        "phrases": sorted(model("robots.Phrase").objects.exclude(robot=None).values_list("text", flat=True)),
        "sessions": sorted(
            map(list, sessions.values_list("robot__slug", "user__username", "fence", "end_reason"))
        ),
        "log": [list(row) for row in records.order_by("pk").values_list("pk", "kind", "outcome")][:8],
    }


if __name__ == "__main__":
    seed() if sys.argv[1:] == ["seed"] else print(json.dumps(facts()))
