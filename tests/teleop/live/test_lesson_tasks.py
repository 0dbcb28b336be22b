"""The tasks that a lesson leaves to its members are enforced at the door of tasks and in the bridge's grant."""

import pytest
from django.utils import timezone
from msgspec import structs

from fleet.bookings.lessons.tasks import lesson_tasks_set
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from teleop.background.database import in_database
from teleop.control.allowed.lesson_tasks import check_lesson
from tests.teleop.live.test_lesson import lesson, until  # noqa: F401  # a fixture

pytestmark = pytest.mark.django_db(transaction=True)

TASKS = wire.LessonTasks(max_share=0.3, motions=["wave"], phrases=["Hello."], places=["Kitchen"])
LEFT_OUT = [
    ("play", {"motion": "home"}),
    ("say", {"text": "Buy my book.", "language": "en-GB"}),
    ("go", {"x": 1.0, "y": 2.0, "heading": 0.0}),
    ("go", {"x": 0.0, "y": 0.0, "heading": 0.0, "place": "Balcony"}),
    ("publish", {"topic": "/play_motion/goal", "type": "std_msgs/String"}),
    ("move_limb", {"limb": "gripper", "to_m": 0.02}),
]
LEFT = [
    ("play", {"motion": "wave"}),
    ("say", {"text": "Hello.", "language": "en-GB"}),
    ("publish", {"topic": "/key_vel", "type": "geometry_msgs/Twist", "sent_ms": 1}),
]


@pytest.fixture
def chosen(lesson):  # noqa: F811
    lesson_tasks_set(booking_id=lesson.pk, tasks=TASKS, actor=lesson.person, now=timezone.now())
    return lesson


async def test_a_member_gets_only_what_the_lesson_leaves(chosen, open_page, bridge, allow):
    allow(Allowed("publish", "/play_motion/goal", "std_msgs/String", "", "operator"))
    student = await open_page("operator")
    await student.say("take")
    mine = await until(student, lambda control: control["state"] == "yours")
    assert mine["tasks"]["motions"] == ["wave"]
    assert (await bridge.hears(wire.Grant)).max_share == 0.3
    for number, (kind, fields) in enumerate(LEFT_OUT, 1):
        await student.say(kind, fence=mine["fence"], seq=number, **fields)
        refused = await student.hears("refused", of=kind, seq=number)
        assert refused["refusal"]["code"] == "not_in_lesson_tasks", (kind, fields)
    for number, (kind, fields) in enumerate(LEFT, 10):
        await student.say(kind, fence=mine["fence"], seq=number, **fields)
        await student.hears("accepted", of=kind, seq=number)


@pytest.mark.parametrize(
    ("request_", "without"),
    [
        (wire.Play(fence=1, motion="wave"), "motions"),
        (wire.MoveLimb(fence=1, limb="gripper", to_m=0.02), "motions"),
        (wire.Say(fence=1, text="Hello.", language="en-GB"), "phrases"),
        (wire.Go(fence=1, x=0.0, y=0.0, heading=0.0, place="Kitchen"), "places"),
    ],
)
def test_a_lesson_may_be_without_motions_speech_or_drives_to_places(request_, without):
    listed = structs.replace(TASKS, without=[without])
    assert check_lesson(listed, request_).code == "not_in_lesson_tasks"
    others = {"motions", "phrases", "places"} - {without}
    assert check_lesson(wire.LessonTasks(without=list(others)), request_) is None
    topic = wire.Publish(fence=1, topic="/play_motion/goal", type="std_msgs/String", fields={})
    assert check_lesson(wire.LessonTasks(without=[without]), topic).code == "not_in_lesson_tasks"


async def test_the_teacher_is_not_bound_and_a_change_counts_at_once(chosen, open_page, bridge):
    student = await open_page("operator")
    await student.say("take")
    await until(student, lambda control: control["state"] == "yours")
    wider = wire.LessonTasks(max_share=0.6)
    choose = {"booking_id": chosen.pk, "tasks": wider, "actor": chosen.person, "now": timezone.now()}
    await in_database(lambda: lesson_tasks_set(**choose))
    await bridge.hears(wire.Grant, lambda grant: grant.max_share == 0.6)
    teacher = await open_page("supervisor")
    await teacher.say("take_over", reason="")
    drives = await until(teacher, lambda control: control["state"] == "yours")
    assert drives["tasks"] is None
    await bridge.hears(wire.Grant, lambda grant: grant.fence == drives["fence"] and grant.max_share == 1.0)
    await teacher.say("play", fence=drives["fence"], seq=1, motion="home")
    await teacher.hears("accepted", of="play", seq=1)
