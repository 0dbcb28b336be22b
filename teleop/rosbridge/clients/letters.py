"""Letters that clients of a robot send each other: calls of services, goals of actions, messages of topics."""

from __future__ import annotations

from typing import Any, Literal

from msgspec import Struct

from robots.shared.wire import Refusal

CLIENT_LEFT = Refusal("client_left", "The client that offers this left.", "wire")

Kind = Literal["service", "action", "topics"]  # topics: of an action, as in ROS 1


class Address(Struct, frozen=True):
    """One client of one web process."""

    process: str
    client: str


class Offer(Struct, frozen=True):
    """An offer of a client to others, by its one name under /fleet/clients/."""

    kind: Kind
    name: str
    type: str
    client: str


class Call(Struct, frozen=True, tag=True):
    """A call of a service. Answer: `Answer`, by the number that the caller gave."""

    number: str
    name: str
    args: dict[str, Any]


class Answer(Struct, frozen=True, tag=True):
    number: str
    values: dict[str, Any] = {}
    refusal: Refusal | None = None


class Goal(Struct, frozen=True, tag=True):
    """A goal for an action, under the id of the client that sends it. Answers: `Feedback`, and one `Result`."""

    id: str
    name: str
    args: dict[str, Any]
    feedback: bool


class Cancel(Struct, frozen=True, tag=True):
    id: str


class Feedback(Struct, frozen=True, tag=True):
    id: str
    values: Any


class Result(Struct, frozen=True, tag=True):
    """The end of a goal. `fields`: of the operation; or why the goal was not carried out."""

    id: str
    fields: dict[str, Any] = {}
    refusal: Refusal | None = None


class Shown(Struct, frozen=True, tag=True):
    """A message on a topic, for all clients."""

    topic: str
    message: dict[str, Any]


class Gone(Struct, frozen=True, tag=True):
    """A web process and its clients are gone, for all clients."""

    process: str


Letter = Call | Answer | Goal | Cancel | Feedback | Result | Shown | Gone


def returned(letter: Letter) -> Letter | None:
    """Return the answer to a letter whose client has left; None: it needs none."""
    match letter:
        case Call(number=number):
            return Answer(number, refusal=CLIENT_LEFT)
        case Goal(id=id_):
            return Result(id_, refusal=CLIENT_LEFT)
        case _:
            return None
