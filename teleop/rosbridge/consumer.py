"""The WebSocket of one rosbridge client of one robot."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from itertools import count
from typing import Any

import msgspec
from django.db import DatabaseError

from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import TokenInvalid
from fleet.server import PING, READ_ON, WRITABLE
from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import (
    Accepted,
    BridgeGone,
    Control,
    Level,
    NotDone,
    Notice,
    Refusal,
    Refused,
    TaskRequest,
    WireError,
)
from teleop.background.jobs import run_in_background
from teleop.control.allowed.scopes import ACTING, needed_scopes, scope_missing
from teleop.control.changes import database_refusal
from teleop.control.lease_checks import NO_LEASE
from teleop.control.status import RobotEntry
from teleop.live.consumers.controlling_socket import ControllingSocket
from teleop.live.consumers.message_socket import BUSY, CloseCode
from teleop.live.control_holder import ControlHolder
from teleop.live.grant_renewal import Delays
from teleop.rosbridge import framing, operations
from teleop.rosbridge.actions.ends import IN_ROS2, REJECTED
from teleop.rosbridge.control_services import STOP
from teleop.rosbridge.families import FAMILIES
from teleop.rosbridge.family import Family, Handler
from teleop.rosbridge.operations import Id, Operation, full_name, operation_of
from teleop.rosbridge.publishing import Publishing
from teleop.rosbridge.reassembly import Reassembly

log = logging.getLogger(__name__)
# Encodes for all clients, one picture after the other: nothing else waits for its thread
_pictures = ThreadPoolExecutor(1, "rosbridge pictures")

STATUS_TOPIC = "/fleet/status"  # the same as the operation status, which roslibpy drops
PING_S = 0.5
MOST_WAITING = 100  # operations of one client
MOST_UNREAD = 1024 * 1024  # characters of what others say, sent to a client that does not read
SIGN_IN_S = 10.0  # the longest time that a client may stay unknown
MOST_UNKNOWN = 50  # clients at once: strangers must not take the places of all WebSockets
_GRAVITY = {"none": 3, "error": 2, "warning": 1, "info": 0}
_SIGN_IN_FIRST = Refusal(
    "sign_in_first",
    "Sign in first: with a token in the header Authorization, by the operation auth, or with a ticket in the address.",
    "account",
)
_NESTED = Refusal("bad_fragment", "Fragments of fragments are not read.", "wire")
_MOVED = "The robot’s bridge is at another address now. Connect again."
_KNOWN = Refusal("signed_in", "This connection is signed in already.", "account")


class RosbridgeConsumer(ControllingSocket):
    """One client: its sign-in, its operations by families, its status messages."""

    through = "rosbridge"
    checked_often = True  # it shows the robot's messages themselves

    def __init__(self) -> None:
        super().__init__()
        self.control_told: Control | None = None
        self.families: list[Family] = []
        self.has_left = False
        self._handlers: dict[type[Operation], Handler] = {
            operations.SetLevel: self._set_level,
            operations.Fragment: self._fragment,
            operations.Auth: self._auth,
        }
        self._publishing: Publishing | None = None
        self._link: BridgeLink | None = None  # of the robot, as its topics are read
        self._level = "warning"
        self._reassembly = Reassembly()
        # Operations that wait: for the link of a new connection, or for a client that does not read
        self._waiting: deque[Operation] = deque()
        self._acting: asyncio.Task[None] | None = None  # on them
        self._numbers = count(1)
        self._answers: dict[int, asyncio.Future[Accepted | Refused]] = {}  # by number of the request
        self._unread = 0  # characters of `MOST_UNREAD`
        self._trip_s: float | None = None  # to the client and back
        self._pinging: asyncio.Task[None] | None = None
        self._unknown: asyncio.TimerHandle | None = None  # closes a connection that nobody signs in

    # --- opening and closing -----------------------------------------------------------------------

    async def on_open(self) -> None:
        """Begin, if the handshake has signed the client in. Else it may still send `auth`."""
        if isinstance(refused := self.scope.get("refused"), TokenInvalid):
            await self._leave_stranger(Refusal(refused.code, refused.text, "account"))
        elif "user" in self.scope:
            await self._begin()
        else:
            self._unknown = asyncio.get_running_loop().call_later(
                SIGN_IN_S, lambda: run_in_background(self._leave_stranger(_SIGN_IN_FIRST))
            )
            _strangers[self] = None
            if len(_strangers) > MOST_UNKNOWN:
                await next(iter(_strangers))._leave_stranger(_SIGN_IN_FIRST)

    async def _begin(self) -> None:
        """Join the robot's hub, if this person may see the robot. From then on a stop waits for nothing."""
        try:
            if await self.join(*ACTING) is None:
                return
        except DatabaseError as error:
            await self.close(CloseCode.TRY_AGAIN, database_refusal(error).text)
            return
        self.prepare()
        # Nobody can resume this lease: it ends with the connection
        self.begin_control(secrets.token_urlsafe(24))
        self._link = self.hub.link
        self.families = [family(self) for family in FAMILIES]
        for family in self.families:
            self._handlers |= family.handlers()
            if isinstance(family, Publishing):
                self._publishing = family
        if ping := self.scope.get("extensions", {}).get(PING):
            self._pinging = run_in_background(self._keep_pinging(ping))
        if read_on := self.scope.get("extensions", {}).get(READ_ON):
            read_on()
        self._acting = run_in_background(self._settle())

    async def _settle(self) -> None:
        """Wait for the link, and tell the client if the robot is out of reach. Then act on what has come meanwhile."""
        try:
            await self.hub.read_status_for(self)
        except DatabaseError as error:
            await self.close(CloseCode.TRY_AGAIN, database_refusal(error).text)
        await self.hub.wait_for_link()
        self.report_bridge_gone()
        await self._act_on_waiting()

    async def _act_on_waiting(self) -> None:
        """Act on what waits, as fast as the client reads the answers."""
        extensions = self.scope.get("extensions", {})
        while self._waiting and not self.has_left:  # before Python 3.12, `wait_for` may lose a cancellation
            if writable := extensions.get(WRITABLE):
                await writable.wait()
            await self._act(self._waiting.popleft())

    async def _keep_pinging(self, ping: Callable[[Callable[[float], None]], None]) -> None:
        """While the client has control, see that it is there, and how far away: it may have nothing to send."""
        while True:
            await asyncio.sleep(PING_S)
            if self.fence is not None or self.waits:
                ping(self._answered)

    def _answered(self, trip_s: float) -> None:
        self._trip_s, self.heard_s = trip_s, time.monotonic()

    def delays(self) -> Delays:
        silent_s = time.monotonic() - self.heard_s if self._pinging else None
        return Delays(self._trip_s, None, silent_s)

    async def _leave_stranger(self, refusal: Refusal) -> None:
        _strangers.pop(self, None)
        if not self.joined:
            await self.status("error", refusal.coded_text)
            await self.close(CloseCode.SIGNED_OUT, refusal.text[:120])

    async def on_close(self) -> None:
        """End everything that the client has: control too."""
        _strangers.pop(self, None)
        if self._unknown:
            self._unknown.cancel()
        if self._pinging:
            self._pinging.cancel()
        if self._acting:
            self._acting.cancel()
        self.has_left = True
        try:
            for family in self.families:
                family.leave()
        finally:  # control ends whatever happens
            await super().on_close()

    async def end_control(self, control: ControlHolder) -> None:
        """End it: the client's next connection has to take control itself."""
        if control.fence is not None:
            await control.release()
        await super().end_control(control)

    async def robot_edited(self, entry: RobotEntry) -> None:
        """Close if the robot has another link now: the client then connects again."""
        if self._link is not None and self.hub.link is not self._link:
            await self.close(CloseCode.TRY_AGAIN, _MOVED)

    # --- operations of the client ------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        """Act on one operation. A stop waits for nothing."""
        try:
            operation = operation_of(raw)
        except WireError as error:
            await self._refuse_misfit(_heading(raw), error.refusal)
            return
        if isinstance(operation, operations.CallService) and self._is_stop(operation.service):
            if self._press_stop() and self.is_behind():
                return  # the answers of a flood would fill the memory
        elif not await self.within_budget(wire.kind_of(operation)):
            return
        elif self._must_wait(operation):
            await self._wait(operation)
            return
        await self._act(operation)

    async def _refuse_misfit(self, heading: _Heading, refusal: Refusal) -> None:
        """Refuse an operation that is not valid. What is called a stop stops, whatever its other fields are."""
        if heading.op == "call_service" and self._is_stop(heading.service):
            if self._press_stop():
                return
        elif not await self.within_budget(heading.op):
            return
        await self.refuse(heading.op, refusal, heading.id)
        if (answer := _failure(heading, refusal)) and not self.is_behind():
            await self.send(answer)

    def _must_wait(self, operation: Operation) -> bool:
        """Return whether the operation has to wait: its answer could not be sent, or it needs the link."""
        if not self.families or not (self._is_acting or self.is_behind()):
            return False
        if isinstance(operation, operations.Fragment):  # perhaps of a stop
            return False
        return not (self._publishing and self._publishing.drives(operation))

    async def _wait(self, operation: Operation) -> None:
        if len(self._waiting) >= MOST_WAITING:
            await self.refuse(wire.kind_of(operation), BUSY, operation.id)
            return
        self._waiting.append(operation)
        if not self._is_acting:
            self._acting = run_in_background(self._act_on_waiting())

    @property
    def _is_acting(self) -> bool:
        return self._acting is not None and not self._acting.done()

    async def _act(self, operation: Operation) -> None:
        of = wire.kind_of(operation)
        try:
            if not self.families and not isinstance(operation, operations.Auth | operations.SetLevel):
                raise NotDone(_SIGN_IN_FIRST)
            handler = self._handlers.get(type(operation))
            if handler is None:
                raise NotDone(
                    Refusal(
                        "not_offered", say("The console does not offer {operation}.", operation=of), "wire"
                    )
                )
            await handler(operation)
        except NotDone as refused:
            await self.refuse(of, refused.refusal, operation.id)

    def _is_stop(self, service: object) -> bool:
        return isinstance(service, str) and full_name(service) == STOP and self.joined

    def _press_stop(self) -> bool:
        """Send the stop. It counts for the flood limit, but is never refused. Return whether it exceeds the limit."""
        flood = not self.spend()
        self.stop_answer = self.stop_button.press(self.hub.link, flood=flood)
        return flood

    def on_message_at_once(self, raw: str) -> bool:
        """Forward the holder's velocity to a bridge on this computer."""
        return self.fence is not None and self._publishing is not None and self._publishing.at_once(raw)

    async def _fragment(self, fragment: operations.Fragment) -> None:
        """Act on an operation in fragments when it is whole. Each fragment has counted as one operation."""
        if (raw := self._reassembly.add(fragment, time.monotonic())) is None:
            return
        operation = operation_of(raw)
        if isinstance(operation, operations.Fragment):
            raise NotDone(_NESTED)
        if isinstance(operation, operations.CallService) and self._is_stop(operation.service):
            self.stop_answer = self.stop_button.press(self.hub.link)
        elif self._must_wait(operation):
            await self._wait(operation)
            return
        await self._act(operation)

    async def _set_level(self, operation: operations.SetLevel) -> None:
        self._level = operation.level

    async def _auth(self, operation: operations.Auth) -> None:
        if self.joined:
            raise NotDone(_KNOWN)
        try:
            self.scope = {**self.scope, **await self.scope["sign_in"](operation.mac)}
        except TokenInvalid as error:
            await self._leave_stranger(Refusal(error.code, error.text, "account"))
            return
        if self._unknown:
            self._unknown.cancel()
        _strangers.pop(self, None)
        await self._begin()

    # --- requests to the bridge (family.Client) -------------------------------------------------------

    def require(self, *scopes: Scope) -> None:
        if not self.opens(*scopes):
            raise NotDone(scope_missing(scopes))

    def next_number(self) -> int:
        return next(self._numbers)

    async def request(self, make: Callable[[int, int], TaskRequest]) -> None:
        if (fence := self.fence) is None:
            raise NotDone(NO_LEASE)
        message = make(fence, self.next_number())
        self.require(*needed_scopes(message))
        answer = self._answers[message.seq] = asyncio.get_running_loop().create_future()
        try:
            await self.tasks.start(message)
            answered = await answer
        finally:
            del self._answers[message.seq]
        if isinstance(answered, Refused):
            raise NotDone(answered.refusal)

    async def answer(self, answer: Accepted | Refused) -> None:
        """Pass the answer to the request that waits for it."""
        waiting = self._answers.get(answer.seq or 0)
        if waiting is not None and not waiting.done():
            waiting.set_result(answer)

    # --- messages to the client -----------------------------------------------------------------------

    async def send(self, operation: Mapping[str, Any] | bytes) -> None:
        if isinstance(operation, bytes):
            if not self._closing:
                await self.send_bytes(operation)
        else:
            await self.send_text(wire.encode(operation).decode())

    async def send_text(self, text: str) -> None:
        await self.send_encoded(text)

    async def pass_on(self, operation: Mapping[str, Any]) -> bool:
        text = wire.encode(operation).decode()
        self._unread = self._unread + len(text) if self.is_behind() else 0
        if self._unread > MOST_UNREAD:
            return False
        await self.send_text(text)
        return True

    async def send_as(self, text: str, compression: str, fragment_size: int | None) -> None:
        if compression == "png":
            text = await asyncio.get_running_loop().run_in_executor(_pictures, framing.as_png, text)
        for part in framing.fragments(text, fragment_size or len(text), f"fragment:{self.next_number()}"):
            await self.send_text(part)
            await asyncio.sleep(0)  # drive input does not wait for all of them

    async def status(self, level: Level, text: str, id_: Id = None) -> None:
        told = {"level": level, "msg": text} | ({} if id_ is None else {"id": id_})
        if _GRAVITY[level] >= _GRAVITY[self._level]:
            await self.send({"op": "status", **told})
        for family in self.families:
            await family.show(STATUS_TOPIC, told)

    async def refuse(self, of: str, refusal: Refusal, id_: Id = None) -> None:
        self._record_refusal(of, refusal)
        if self._replies.spend(time.monotonic()):
            await self.status("error", refusal.coded_text, id_)

    async def send_message(self, message: Any) -> None:
        """Tell the client what a page would get as a message of the console's own protocol."""
        match message:
            case Control():
                self.control_told = message
                for family in self.families:
                    family.control_changed(message)
            case Notice(level=level, code=code, text=text):
                await self.status(level, f"{code}: {text}")
            case Refused(refusal=refusal) | BridgeGone(refusal=refusal):
                await self.status("error", refusal.coded_text)


_strangers: dict[RosbridgeConsumer, None] = {}  # clients that have not signed in, the oldest first


class _Heading(msgspec.Struct):
    op: str = ""
    id: Any = None
    service: Any = ""
    action: Any = ""


def _heading(raw: str) -> _Heading:
    """Return the heading of an operation that is not valid, as far as it can be read."""
    try:
        found = _heading_of(raw[: operations.LARGEST_BYTES])
    except (msgspec.DecodeError, UnicodeError, RecursionError):
        return _Heading()
    with suppress(msgspec.ValidationError):
        return _Heading(found.op[:40], msgspec.convert(found.id, Id), found.service, found.action)
    return _Heading(found.op[:40], None, found.service, found.action)


_heading_of = msgspec.json.Decoder(_Heading).decode


def _failure(heading: _Heading, refusal: Refusal) -> dict[str, Any] | None:
    """Return the end of a call or goal that is not valid: its client may wait for it without a limit."""
    if heading.id is None:
        return None
    told = {"id": heading.id, "values": refusal.coded_text, "result": False}
    match heading.op:
        case "call_service":
            return {"op": "service_response", "service": str(heading.service)[:200], **told}
        case "send_action_goal":
            status = IN_ROS2[REJECTED]
            return {"op": "action_result", "action": str(heading.action)[:200], "status": status, **told}
        case _:
            return None
