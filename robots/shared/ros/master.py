"""Calls a ROS master over XML-RPC, with time-outs, and detects its death at once."""

from __future__ import annotations

import http.client
import socket
import time
import xmlrpc.client
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar
from urllib.parse import urlsplit

import msgspec

from robots.shared import texts
from robots.shared.graph import SystemState
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.sentences import say
from robots.shared.unreachable import Unreachable

TIMEOUT_S = 1.0
WHOLE_S = 5.0  # a whole call: an answer may have a hundred kilobytes and come by slow radio
LARGEST_ANSWER = 64 * 1024 * 1024  # bytes read from the network
MOST_VALUES = 500_000  # in an answer
REMEMBERED = 64 * 1024  # bytes: only a smaller answer is remembered

T = TypeVar("T")
_Nodes = list[tuple[str, list[str]]]  # by topic


class MasterError(Unreachable):
    """The master does not answer, or reports a failure. The text is for people."""


class NotThere(MasterError):
    """The master answers that it has no such name, or refuses the call."""


def left_s(until_s: float) -> float:
    """Return the time until `until_s` on the monotonic clock. Raises TimeoutError if it has passed."""
    left_s = until_s - time.monotonic()
    if left_s <= 0.0:
        raise TimeoutError(say("timed out"))
    return left_s


class _Reader(xmlrpc.client.Unmarshaller):
    """Parses an answer. Each text is cut at `longest` characters while it is read."""

    def __init__(self, longest: int) -> None:
        super().__init__()
        self._longest = longest
        self._room = longest
        self._values_left = MOST_VALUES

    def start(self, tag: str, attrs: dict[str, str]) -> None:
        self._room = self._longest
        self._values_left -= 1
        if self._values_left < 0:
            raise xmlrpc.client.ResponseError(say("the answer has too many values"))
        super().start(tag, attrs)

    def data(self, text: str) -> None:
        if self._room > 0:
            super().data(text[: self._room])
            self._room -= len(text)


class _Answer(NamedTuple):
    """A whole answer, and what it means: a master mostly answers the same as before."""

    raw: bytes | None
    value: Any


_NONE = _Answer(None, None)


class _Transport(xmlrpc.client.Transport):
    """Transport of one call: each wait takes at most `timeout_s`, the whole call at most `WHOLE_S`."""

    accept_gzip_encoding = False

    def __init__(self, timeout_s: float, longest: int, before: _Answer = _NONE) -> None:
        super().__init__()
        self.answer = before
        self._timeout_s = timeout_s
        self._longest = longest
        self._until_s = time.monotonic() + WHOLE_S

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        if not connection.sock:
            connection.timeout = self._timeout_s
            connection.connect()
            connection.sock = _Socket(connection.sock, self._timeout_s, self._until_s)
        return connection

    def getparser(self) -> Any:
        reader = _Reader(self._longest)
        return xmlrpc.client.ExpatParser(reader), reader

    def parse_response(self, response: Any) -> Any:
        if response.getheader("Content-Encoding"):
            raise xmlrpc.client.ResponseError("the answer is compressed, which was not requested")
        raw = response.read(REMEMBERED)
        if raw == self.answer.raw:
            return self.answer.value
        parser, reader = self.getparser()
        parser.feed(raw)
        is_whole = True
        while more := response.read(REMEMBERED):
            parser.feed(more)
            is_whole = False
        parser.close()
        value = reader.close()
        self.answer = _Answer(raw, value) if is_whole and len(raw) < REMEMBERED else _NONE
        return value


class _Socket(socket.socket):
    """A connection whose reads and writes end at `until_s`, even if the other side is slow."""

    def __init__(self, connection: socket.socket, timeout_s: float, until_s: float) -> None:
        super().__init__(fileno=connection.detach())
        self._timeout_s, self._until_s = timeout_s, until_s
        self._left = LARGEST_ANSWER

    def recv_into(self, *into: Any) -> int:
        """Read a part of the answer. OSError if the answer is too large."""
        self._limit()
        size = super().recv_into(*into)
        self._left -= size
        if self._left < 0:
            raise OSError(say("its answer has more than {most} bytes", most=LARGEST_ANSWER))
        return size

    def sendall(self, *what: Any) -> None:
        """Send all bytes, within the time limit."""
        self._limit()
        super().sendall(*what)

    def _limit(self) -> None:
        self.settimeout(min(self._timeout_s, left_s(self._until_s)))


class Master:
    """One master (or one node) that the node `caller` calls.

    Calls raise MasterError after `timeout_s` of silence, and after `WHOLE_S` in any case. The host name is
    resolved before that, without a limit of ours: this computer's resolver decides how long it tries.
    """

    def __init__(self, uri: str, caller: str, timeout_s: float = TIMEOUT_S) -> None:
        self.uri = uri
        self._caller = caller
        self._timeout_s = timeout_s
        self._answers = {"getSystemState": _NONE, "getTopicTypes": _NONE}

    def alive(self) -> None:
        """Return if the master answers, else raise MasterError."""
        self.call("getPid")

    def node_uri(self, node: str) -> str | None:
        """Return the XML-RPC address of a registered node; None if no node has this name."""
        try:
            return self._call_typed(str, "lookupNode", node)
        except NotThere:
            return None

    def register(self, kind: str, topic: str, type_name: str, node_uri: str) -> list[str]:
        """Call registerPublisher or registerSubscriber; return the addresses of the topic's other side."""
        return self._call_typed(list[str], kind, topic, type_name, node_uri)

    def parameter(self, name: str) -> Any:
        """Return the parameter's value; None if there is no such parameter."""
        try:
            return self.call("getParam", name, longest=texts.DESCRIPTION)
        except NotThere:
            return None

    def system_state(self) -> SystemState:
        """Return publishers, subscribers and types of all topics, and service providers; long names are cut."""
        system_state_parts = self._call_typed(tuple[_Nodes, _Nodes, _Nodes], "getSystemState")
        publishers, subscribers, services = map(texts.books, system_state_parts)
        types = texts.cut_types(self._call_typed(list[tuple[str, str]], "getTopicTypes"))
        types.update(_goal_types(publishers, types))
        is_cut = max(map(len, system_state_parts)) > texts.MOST_TOPICS
        return SystemState(publishers, subscribers, types, services, is_cut)

    def call(self, method: str, *arguments: object, longest: int = texts.ANSWER) -> Any:
        """Call a method of the master (or slave) API; return its value, with texts cut at `longest`."""
        try:
            transport = _Transport(self._timeout_s, longest, self._answers.get(method, _NONE))
            with xmlrpc.client.ServerProxy(self.uri, transport=transport) as proxy:
                code, text, value = getattr(proxy, method)(self._caller, *arguments)
            if method in self._answers:
                self._answers[method] = transport.answer
        except socket.gaierror as error:
            host = urlsplit(self.uri).hostname
            raise MasterError(
                say("The name {host} cannot be resolved here: give the robot a host alias.", host=host)
            ) from error
        except TimeoutError as error:
            raise MasterError(say("The ROS master at {uri} does not answer.", uri=self.uri)) from error
        except Exception as error:  # any fault of the other side, also its death while it answers
            why = texts.cut(str(error), texts.SENTENCE)
            raise MasterError(
                say("No ROS master answers at {uri} ({why}).", uri=self.uri, why=why)
            ) from error
        if code != 1:
            raise (NotThere if code == -1 else MasterError)(texts.cut(str(text), texts.SENTENCE))
        return value

    def _call_typed(self, kind: type[T], method: str, *arguments: object) -> T:
        """Call and convert the value to `kind`. Raises MasterError if it does not fit."""
        value = self.call(method, *arguments)
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError as error:
            why = texts.cut(str(error), texts.SENTENCE)
            raise MasterError(
                say("No ROS master answers at {uri} ({method}: {why}).", uri=self.uri, method=method, why=why)
            ) from error


def require_ipv4(uri: str) -> None:
    """Raise MasterError if the host of this address has no IPv4 address: ROS 1 nodes cannot join it.

    With ROS_IPV6 rospy calls itself http://::1:35681/, which no node can read.
    """
    host = urlsplit(uri).hostname or ""
    try:
        socket.getaddrinfo(host, None, socket.AF_INET)
    except socket.gaierror as error:
        raise MasterError(
            say(
                "The name {host} has no IPv4 address here, and ROS 1 needs one: give the robot a host alias.",
                host=host,
            )
        ) from error


def _goal_types(publishers: Mapping[str, object], types: Mapping[str, str]) -> dict[str, str]:
    """Return the goal types of actions, as the action servers advertise them.

    For a goal topic itself, the master returns the type that was advertised last, maybe by this console.
    """
    results = {topic: types.get(topic, "") for topic in publishers if topic.endswith("/result")}
    return {
        f"{topic.removesuffix('result')}goal": f"{kind.removesuffix('Result')}Goal"
        for topic, kind in results.items()
        if kind.endswith("ActionResult")
    }


class DeathWatch:
    """An idle TCP connection to the master: the kernel closes it when the master dies. Raises MasterError."""

    def __init__(self, uri: str) -> None:
        parts = urlsplit(uri)
        try:
            self._socket = socket.create_connection((parts.hostname or "", parts.port or 80), TIMEOUT_S)
        except OSError as error:
            raise MasterError(
                say("No ROS master answers at {uri} ({error}).", uri=uri, error=error)
            ) from error

    def wait(self, timeout_s: float) -> bool:
        """Return whether the master died within `timeout_s`."""
        self._socket.settimeout(timeout_s)
        try:
            self._socket.recv(1)
        except TimeoutError:
            return False
        except OSError:
            return True
        return True

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def node_alive(uri: str, node: str) -> bool | None:
    """Return whether this node answers at this XML-RPC address; True as well if its host name does not resolve here.

    None: the node is silent or out of reach now. False: no process listens there, or another one does.
    """
    try:
        return bool(Master(uri, BRIDGE).call("getName") == node)
    except MasterError as error:
        why = error.__cause__
        if isinstance(why, socket.gaierror):
            return True  # the node may live: only the robot can resolve its name
        return None if isinstance(why, OSError) and not isinstance(why, ConnectionRefusedError) else False


def why_silent(uri: str) -> str:
    """Return in words why a registered node at this XML-RPC address does not connect: it has ended, or hangs.

    "" if it answers, or if its host name does not resolve here: then its state is unknown.
    """
    try:
        Master(uri, BRIDGE).alive()
    except MasterError as error:
        why = error.__cause__
        if isinstance(why, ConnectionRefusedError):
            return say("its process has ended: start it again (the master still has its name)")
        if isinstance(why, OSError) and not isinstance(why, socket.gaierror):
            return say("it does not answer at {uri}: it hangs, or this computer cannot reach it", uri=uri)
    return ""
