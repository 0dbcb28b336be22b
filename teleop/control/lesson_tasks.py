"""Which tasks a lesson leaves to its members."""

from __future__ import annotations

from robots.places.entries import key_of
from robots.shared import wire
from robots.shared.messages import twists
from robots.shared.sentences import Sentence, say
from robots.shared.wire import LessonTasks, Refusal, TaskRequest


def check_lesson(tasks: LessonTasks | None, request: TaskRequest) -> Refusal | None:
    """Return why a member of a lesson may not request this task in it.

    A message to a topic could be any task, so none passes where motions, phrases or places are chosen; twists go
    through the gate.
    """
    if tasks is None or (what := _left_out(tasks, request)) is None:
        return None
    text = say(
        "{what} is not part of this lesson: choose what the page offers, or ask the teacher.", what=what
    )
    return Refusal("not_in_lesson_tasks", text, "booking", {"what": str(what)})


def _left_out(tasks: LessonTasks, request: TaskRequest) -> str | Sentence | None:
    """Return the name of what is requested, if the lesson leaves it out."""
    match request:
        case wire.Play(motion=motion) if tasks.motions and motion not in tasks.motions:
            return motion
        case wire.MoveLimb() if tasks.motions:  # a motion without a name
            return say("This movement")
        case wire.Say(text=text) if tasks.phrases and text.strip() not in tasks.phrases:
            return say("This text")
        case wire.Go(place=place) if tasks.places and key_of(place) not in map(key_of, tasks.places):
            return place or say("This goal")
        case wire.Publish(type=type_, topic=topic) if type_ not in twists.TYPES:
            return topic if tasks.motions or tasks.phrases or tasks.places else None
    return None
