"""The WebSocket of one Foxglove client of one robot. It reads; whatever it sends to the robot is refused."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import TokenInvalid
from robots.link.client import LinkRefused
from robots.link.tap_link import STARTING
from robots.shared import wire
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.wire import BridgeGone, Form, Notice, Refusal, Refused, TapState
from teleop.background.jobs import run_in_background
from teleop.control.status import RobotEntry
from teleop.foxglove import connection_graph, protocol
from teleop.foxglove.catalogue import Catalogue, Change, catalogue_of
from teleop.foxglove.protocol import Channel, encoded
from teleop.live.consumers.message_socket import BUSY, CloseCode
from teleop.live.consumers.robot_socket import RobotSocket
from teleop.records.camera_audit import TOO_MANY_CAMERAS, CameraAudit, is_picture
from teleop.tap.feed import TapMessage, TapReader, feed_of

CLOCK = "/clock"
CLOCK_S = 0.02  # between two times
QUEUE = 10  # messages of a topic that wait for a client that is behind; of pictures only the newest
PARAMETERS_PER_S = 1.0  # readings: the answer may be large
PARAMETERS_BURST = 10.0

_READ_ONLY = Refusal(
    "read_only",
    "Lichtblick and Foxglove only read. Act on the robot’s page, or through the API or rosbridge.",
    "account",
)
_NO_FILES = Refusal("not_offered", "The console sends no files through this door.", "wire")
_SIGN_IN = Refusal(
    "sign_in_first",
    "Sign in with a token in the header Authorization, or with a new ticket in the address.",
    "account",
)
_SUBSCRIBED = Refusal(
    "subscribed_already",
    "This channel is subscribed already, or the number of the subscription is in use.",
    "wire",
)
_MOVED = "The address of the robot has changed: connect again."
_SUBPROTOCOL = f"Offer the subprotocol {' or '.join(protocol.SUBPROTOCOLS)}."


class _Subscribed(NamedTuple):
    number: int  # the client's
    channel: Channel


class FoxgloveConsumer(RobotSocket):
    """One client: its channels and subscriptions, the connection graph, parameters."""

    through = "foxglove"
    checked_often = True  # it shows the robot's messages themselves
    subprotocols = protocol.SUBPROTOCOLS

    def __init__(self) -> None:
        super().__init__()
        self._catalogue: Catalogue | None = None
        self._reader: TapReader | None = None
        self._camera_audit: CameraAudit | None = None
        self._subscriptions: dict[str, _Subscribed] = {}  # by topic
        self._types: dict[str, str] = {}  # of topics, as their publishers say
        self._follows_graph = False
        self._clock_ns: int | None = None  # by the robot's simulated clock
        self._has_clock = False
        self._parameters = TokenBucket(PARAMETERS_PER_S, PARAMETERS_BURST)

    # --- opening and closing -----------------------------------------------------------------------

    async def on_open(self) -> None:
        """Tell the client what the robot has, if its person may see the robot."""
        if not set(self.scope.get("subprotocols", ())) & set(protocol.SUBPROTOCOLS):
            await self.close(CloseCode.NOT_SPOKEN, _SUBPROTOCOL)
            return
        if "user" not in self.scope:
            refused = self.scope.get("refused")
            invalid = isinstance(refused, TokenInvalid)
            why = Refusal(refused.code, refused.text, "account") if invalid else _SIGN_IN
            await self._status(protocol.ERROR, why.coded_text)
            await self.close(CloseCode.SIGNED_OUT, why.text[:120])
            return
        entry = await self.join(Scope.TOPICS)
        if entry is None:
            return
        self._camera_audit = CameraAudit(self.user, self.robot_id, entry.facts.name)
        await self.hub.wait_for_link()
        await self._begin(entry)

    async def _begin(self, entry: RobotEntry) -> None:
        catalogue = catalogue_of(self.hub.link)
        catalogue.add(self)
        self._catalogue = catalogue
        await catalogue.first_read()
        clock = catalogue.channels.get(CLOCK)
        self._has_clock = clock is not None and protocol.is_clock(clock.schemaName)
        info = encoded(
            "serverInfo",
            name=entry.facts.name,
            capabilities=["parameters", "connectionGraph", *(["time"] if self._has_clock else [])],
            supportedEncodings=[],
            # clients choose their kind of ROS by it
            metadata={"ROS_DISTRO": "humble" if entry.facts.ros == 2 else "noetic"},
            sessionId=self.id,
        )
        channels = catalogue.whole()
        feed = feed_of(self.hub.link)
        self._reader = TapReader(feed, self._deliver, self._follow_topic, self.is_behind, self.user.pk)
        await self._send_all([info, channels])
        if clock is not None and self._has_clock:
            self._read(clock)
        if refusal := catalogue.refusal:
            self.catalogue_refused(refusal)

    async def on_close(self) -> None:
        """End all subscriptions."""
        self._end_reading()
        if self.joined:
            await self.hub.remove(self)

    async def revoke_access(self, refusal: Refusal) -> None:
        """End all subscriptions and close: this person may not see the robot any more."""
        self._end_reading()
        await super().revoke_access(refusal)

    def _end_reading(self) -> None:
        if self._catalogue:
            self._catalogue.remove(self)
        if self._reader:
            self._reader.leave()
        if self._camera_audit:
            self._camera_audit.end_all()
        self._catalogue = self._reader = None
        self._subscriptions.clear()

    async def robot_edited(self, entry: RobotEntry) -> None:
        """End the connection if the robot has another link now: the client then connects again."""
        if self._catalogue is not None and self._catalogue.link is not self.hub.link:
            await self.close(CloseCode.TRY_AGAIN, _MOVED)

    # --- requests ----------------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        request = protocol.request_of(raw)
        if self._catalogue is None or not await self.within_budget(wire.kind_of(request)):
            return
        match request:
            case protocol.Subscribe(subscriptions=subscriptions):
                for one in subscriptions:
                    if not await self.within_budget("subscribe"):
                        break
                    await self._subscribe(one)
            case protocol.Unsubscribe(subscriptionIds=numbers):
                ends = frozenset(numbers)
                self._unsubscribe(lambda one: one.number in ends)
            case protocol.GetParameters(parameterNames=names, id=id_):
                await self._send_parameters_later(names, id_)
            case protocol.SetParameters(parameters=parameters, id=id_):
                await self.send_refusal(wire.kind_of(request), _READ_ONLY)
                # Clients show the new value already: tell them the old one
                await self._send_parameters_later([one.name for one in parameters] or [""], id_)
            case protocol.SubscribeConnectionGraph():
                self._follows_graph = True
                await self.send_encoded(connection_graph.whole(self._catalogue.graph))
            case protocol.UnsubscribeConnectionGraph():
                self._follows_graph = False
            case protocol.FetchAsset(requestId=number):
                await self.send_refusal(wire.kind_of(request), _NO_FILES)
                await self.send_bytes(protocol.no_asset(number, _NO_FILES.text))
            case refused:
                await self.send_refusal(wire.kind_of(refused), _READ_ONLY)

    async def on_bytes(self, raw: bytes) -> None:
        """Refuse what a client would send to the robot: a message, or a call of a service."""
        call = protocol.service_call(raw)
        of = "publish" if call is None else "call_service"
        if await self.within_budget(of):
            await self.send_refusal(of, _READ_ONLY)
            if call is not None:
                failure = {"serviceId": call.service, "callId": call.call, "message": _READ_ONLY.text}
                await self.send_encoded(encoded("serviceCallFailure", **failure))

    async def _subscribe(self, asked: protocol.Subscription) -> None:
        channel = self._catalogue.by_id.get(asked.channelId) if self._catalogue else None
        if channel is None:  # it has just ended, and the client will hear of it
            return
        numbers = {one.number for one in self._subscriptions.values()}
        if channel.topic in self._subscriptions or asked.id in numbers:
            await self.send_refusal("subscribe", _SUBSCRIBED)
        elif (refusal := self._read(channel)) is not None:
            await self.send_refusal("subscribe", refusal)
        else:
            self._subscriptions[channel.topic] = _Subscribed(asked.id, channel)

    def _unsubscribe(self, ends: Callable[[_Subscribed], bool]) -> None:
        for topic in [topic for topic, one in self._subscriptions.items() if ends(one)]:
            del self._subscriptions[topic]
            if self._reader and not (topic == CLOCK and self._has_clock):
                self._reader.end(topic, "raw")
                self._types.pop(topic, None)
            if self._camera_audit:
                self._camera_audit.end_viewing(topic)

    def _read(self, channel: Channel) -> Refusal | None:
        if self._reader is None:
            return None
        every_s = CLOCK_S if channel.topic == CLOCK and self._has_clock else 0.0
        queue = 1 if is_picture(channel.schemaName) else QUEUE
        return self._reader.read(channel.topic, "raw", every_s, queue)

    async def _send_parameters_later(self, names: list[str], id_: str | None) -> None:
        if self._parameters.spend(time.monotonic()):
            run_in_background(self._send_parameters(names, id_))
        else:
            await self.send_refusal("getParameters", BUSY)

    async def _send_parameters(self, names: list[str], id_: str | None) -> None:
        if self._catalogue is None:
            return
        try:
            found = await self._catalogue.parameters()
        except LinkRefused as refused:
            await self.send_refusal("getParameters", refused.refusal)
            return
        chosen = [(name, found[name]) for name in names if name in found] if names else found.items()
        values = [{"name": name, "value": value} for name, value in chosen]
        await self.send_encoded(encoded("parameterValues", parameters=values, **({"id": id_} if id_ else {})))

    # --- news of the robot ----------------------------------------------------------------------------

    def catalogue_changed(self, change: Change) -> None:
        """Tell the client, which subscribes new channels itself."""
        if self._reader is None:  # the client gets all channels in a moment
            return
        self._unsubscribe(lambda one: one.channel.id in change.ended)
        messages = [*change.channels, *([change.graph] if change.graph and self._follows_graph else [])]
        run_in_background(self._send_all(messages))

    def catalogue_refused(self, refusal: Refusal) -> None:
        """Tell the client why nothing new comes."""
        if self._reader is None:  # the client gets this in a moment
            return
        run_in_background(self._status(protocol.WARNING, refusal.coded_text))

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """Tell nothing: the catalogue says it."""

    def _follow_topic(self, state: TapState) -> None:
        # The catalogue tells the refusal of the link
        if state.refusal is not None and state.refusal not in (STARTING, self.hub.link.refusal):
            text = f"{state.topic}: {state.refusal.coded_text}"
            run_in_background(self._status(protocol.WARNING, text))
        if state.type:
            self._types[state.topic] = state.type
        if state.definition and self._catalogue is not None:
            self._catalogue.correct(state.topic, state.type, state.definition)

    async def _deliver(self, topic: str, _form: Form, message: TapMessage) -> None:
        type_ = self._types.get(topic, "")
        is_clock = topic == CLOCK and self._has_clock and protocol.is_clock(type_)
        if is_clock and (now_ns := protocol.clock_ns(message.body, type_)) is not None:
            self._clock_ns = now_ns
            await self._send_frame(protocol.time(now_ns))
        subscribed = self._subscriptions.get(topic)
        # A message of another type cannot be read with this channel's definition, and may be a picture
        if subscribed is None or self._camera_audit is None or subscribed.channel.schemaName != type_:
            return
        if is_picture(type_) and not self._camera_audit.begin_or_continue(topic):
            await self.send_refusal("subscribe", TOO_MANY_CAMERAS)
            return
        # A robot with a clock of its own has only its times
        stamp_ns = message.stamp_ns if self._clock_ns is None else self._clock_ns
        await self._send_frame(protocol.message_data(subscribed.number, stamp_ns, message.body))

    # --- to the client --------------------------------------------------------------------------------

    async def send_message(self, message: Any) -> None:
        """Tell the client as a status what a page would get as a message of the console's own protocol."""
        match message:
            case Refused(refusal=refusal) | BridgeGone(refusal=refusal):
                await self._status(protocol.ERROR, refusal.coded_text)
            case Notice(code=code, text=text):
                await self._status(protocol.ERROR, f"{code}: {text}")

    async def _status(self, level: int, text: str) -> None:
        await self.send_encoded(encoded("status", level=level, message=text))

    async def _send_all(self, messages: list[str]) -> None:
        for message in messages:
            await self.send_encoded(message)

    async def _send_frame(self, frame: bytes) -> None:
        if not self._closing:
            await self.send_bytes(frame)
