"""The inspector's refusals."""

from __future__ import annotations

from robots.shared.sentences import say
from robots.shared.wire import Refusal


class Declined(Exception):
    """A request cannot or must not be carried out; `refusal` gives the reason for people."""

    def __init__(self, code: str, text: str, **figures: float | int | str | None) -> None:
        super().__init__(text)
        self.refusal = Refusal(code, text, "robot", figures)


def no_service(name: str) -> Declined:
    return Declined("no_service", say("The robot has no service {name}.", name=name), service=name)


def silent(service: str, within_s: float) -> Declined:
    text = say(
        "{service} did not answer within {seconds} s: whether it was carried out is not known.",
        service=service,
        seconds=within_s,
    )
    return Declined("service_silent", text, service=service)


def no_parameter(name: str) -> Declined:
    return Declined("no_parameter", say("The robot has no parameter {name}.", name=name), name=name)


def lost(service: str, error: object) -> Declined:
    return Declined("service_lost", say("{service}: {error}", service=service, error=error), service=service)


def unknown_type(type_name: str, text: str) -> Declined:
    return Declined("type_unknown", text, type=type_name)
