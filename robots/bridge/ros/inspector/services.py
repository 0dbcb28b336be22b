"""Services: the request type of a service, and one call of it, with a time limit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from robots.bridge.ros.inspector.definitions import parsed
from robots.bridge.ros.network.tcpros import Conversation, connect
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.declined import Declined
from robots.bridge.topics.inspector.side import Service
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition
from robots.shared.ros.master import Master, NotThere
from robots.shared.ros.message_types.classes import UnknownTypeError, service_class
from robots.shared.sentences import say
from robots.shared.texts import NAME, cut

CALL_S = 1.5  # until a service must have answered
TYPES_S = 1.5  # until the types of all services must be known
MOST_ASKED = 16  # services at once


class _At(NamedTuple):
    """The address of a service, and the md5 sum of its type."""

    address: tuple[str, int]
    md5: str


def find(master: Master, name: str) -> Service:
    """Ask a service for its type. Raises MasterError or Declined."""
    address, said = _probed(master, name)
    type_name, md5 = said.get("type", ""), said.get("md5sum", "")
    here = _installed(type_name)
    if here._md5sum != md5:
        text = say(
            "The robot has another version of {type} than the console: it cannot be called from here.",
            type=type_name,
        )
        raise Declined("definition_differs", text, type=type_name, robot_md5=md5, console_md5=here._md5sum)
    return Service(
        name, type_name, described(type_name), described(type_name, response=True), _At(address, md5)
    )


def described(type_name: str, response: bool = False) -> Definition:
    """Return the request or response of an installed service type. Raises Declined."""
    here = _installed(type_name)
    part = here._response_class if response else here._request_class
    return parsed(part._type, part._full_text, known=True)


def types_of(master: Master, names: Iterable[str]) -> dict[str, str]:
    """Ask services for their types, many at once; those that do not answer within `TYPES_S` are missing."""
    asking = ThreadPoolExecutor(MOST_ASKED)
    waiting = {asking.submit(_probed, master, name): name for name in names}
    answered, _ = wait(waiting, TYPES_S)
    asking.shutdown(wait=False, cancel_futures=True)
    return {
        waiting[one]: cut(one.result()[1].get("type", ""), NAME)
        for one in answered
        if one.exception() is None
    }


def host_of(master: Master, name: str) -> str:
    """Return the name or address of a service's computer; "" if there is no such service. Raises MasterError."""
    try:
        return cut(_located(master, name)[0], NAME)
    except Declined:
        return ""


def _installed(type_name: str) -> Any:
    try:
        return service_class(type_name)
    except UnknownTypeError:
        text = say(
            "The console does not know the service type {type}, and services do not send their definition.",
            type=type_name,
        )
        raise Declined("type_unknown", text, type=type_name) from None


def _probed(master: Master, name: str) -> tuple[tuple[str, int], dict[str, str]]:
    """Return the address of a service, and what it says about itself. Raises MasterError or Declined."""
    address = _located(master, name)
    return address, _ask(name, address, {"md5sum": "*", "probe": "1"})


def _located(master: Master, name: str) -> tuple[str, int]:
    """Return the address of a service. Raises MasterError or Declined."""
    try:
        uri = urlsplit(master.call("lookupService", name))
    except NotThere:
        raise declined.no_service(name) from None
    return uri.hostname or "", uri.port or 0


def exchange(service: Service, request: bytes, require_time: Callable[[], None], largest: int) -> bytes:
    """Call a service; return the bytes of its answer. Raises Declined.

    `require_time` is called just before the request is sent, and raises if it is too late.
    """
    at: _At = service.at
    try:
        with _connected(at.address, service.name, {"md5sum": at.md5, "type": service.type}) as conversation:
            conversation.read_header()
            require_time()
            conversation.send(request)
            succeeded, answer = conversation.read(1), _answer(conversation, largest)
    except TimeoutError:
        raise declined.silent(service.name, CALL_S) from None
    except OSError as error:
        raise declined.lost(service.name, error) from error
    if succeeded != b"\x01":
        reason = answer.decode(errors="replace")[:300]
        text = (
            say("{service} reported a failure: {reason}", service=service.name, reason=reason)
            if reason
            else say("{service} reported a failure and gave no reason.", service=service.name)
        )
        raise Declined("service_failed", text, service=service.name)
    return answer


def _answer(conversation: Conversation, largest: int) -> bytes:
    length = conversation.read_length()
    if length > largest:
        raise OSError(say("its answer has {count} bytes", count=length))
    return conversation.read(length)


def _ask(name: str, address: tuple[str, int], wanted: dict[str, str]) -> dict[str, str]:
    try:
        with _connected(address, name, wanted) as conversation:
            said = conversation.read_header()
    except (OSError, ValueError) as error:
        text = say("{service} cannot be reached: {error}", service=name, error=error)
        raise Declined("service_lost", text, service=name) from error
    if "error" in said:
        text = say("{service}: {error}", service=name, error=said["error"])
        raise Declined("service_failed", text, service=name)
    return said


def _connected(address: tuple[str, int], name: str, wanted: dict[str, str]) -> Conversation:
    return connect(*address, {"callerid": INSPECTOR, "service": name, **wanted}, CALL_S)
