"""Which tasks a lesson leaves to its members."""

from __future__ import annotations

from robots.places.entries import key_of
from robots.shared import wire
from robots.shared.messages import twists
from robots.shared.messages.type_names import bare
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
    motions, phrases, places = tasks.chosen("motions"), tasks.chosen("phrases"), tasks.chosen("places")
    match request:
        case wire.Play(motion=motion) if motions is not None and motion not in motions:
            return motion
        case wire.MoveLimb() if motions is not None:  # a motion without a name
            return say("This movement")
        case wire.Say(text=text) if phrases is not None and text.strip() not in phrases:
            return say("This text")
        case wire.Go(place=place) if places is not None and key_of(place) not in map(key_of, places):
            return place or say("This goal")
        case wire.Publish(type=type_, topic=topic) if bare(type_) not in twists.TYPES:
            return None if motions is phrases is places is None else topic
    return None
