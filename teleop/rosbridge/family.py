"""One family of operations of one client. `families.py` lists all families."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from concurrent.futures import Future
from typing import Any, Protocol

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from robots.shared.wire import Control, Level, Refusal, TaskRequest
from teleop.control.status import Rights
from teleop.live.control_holder import ControlHolder
from teleop.live.robot_hub import RobotHub
from teleop.rosbridge.operations import Id, Operation
from teleop.stop.presses import Result

# Acts on one operation. Raises `NotDone` if it refuses it. Must not wait for slow work.
Handler = Callable[[Any], Awaitable[None]]
# Answers one call of a service by its arguments. Runs in the background. Raises `NotDone` if it refuses the call.
Service = Callable[[dict[str, Any]], Awaitable[dict[str, Any]]]


class Client(Protocol):
    """The connection of a client, as families see it."""

    id: str  # of this connection
    hub: RobotHub
    user: User
    rights: Rights
    control: ControlHolder | None
    control_told: Control | None  # the newest report about control
    families: list[Family]
    has_left: bool  # begin nothing for it any more
    stop_answer: Future[Result]  # of its newest stop

    @property
    def fence(self) -> int | None:
        """The fence of its control; None without control."""

    def opens(self, *scopes: Scope) -> bool:
        """Return whether the client's token has one of these scopes."""

    def require(self, *scopes: Scope) -> None:
        """Raise `NotDone` if the client's token has none of these scopes."""

    def spend(self) -> bool:
        """Count one operation. False: it exceeds the flood limit."""

    def forwarded(self, was_sent: bool, began_s: float) -> None:
        """Count a velocity that was passed to the link, by the time since it came (`time.perf_counter`)."""

    def is_behind(self) -> bool:
        """Return whether the client has not read what was sent."""

    def next_number(self) -> int:
        """Return the number of the next request to the bridge."""

    async def request(self, make: Callable[[int, int], TaskRequest]) -> None:
        """Send the task that `make` builds of fence and number; wait until it is accepted. Raises `NotDone`."""

    async def send(self, operation: Mapping[str, Any] | bytes) -> None:
        """Send the client an operation: encoded here as JSON, or bytes that are encoded already (CBOR)."""

    async def pass_on(self, operation: Mapping[str, Any]) -> bool:
        """Send what others say. Return False, without sending it, if too much of that is unread."""

    async def send_text(self, text: str) -> None:
        """Send the client an operation that is encoded as JSON already."""

    async def send_as(self, text: str, compression: str, fragment_size: int | None) -> None:
        """Send an encoded operation as a PNG picture, in fragments, or both."""

    async def status(self, level: Level, text: str, id_: Id = None) -> None:
        """Tell the client something, if it wants to hear of this level."""

    async def refuse(self, of: str, refusal: Refusal, id_: Id = None) -> None:
        """Count and record a refused operation, and tell the client why, within the limit of replies."""


class Family:
    """Base of the families. Each makes an object for each client, after its sign-in."""

    def __init__(self, client: Client) -> None:
        self.client = client

    def handlers(self) -> Mapping[type[Operation], Handler]:
        """Return what handles which operations."""
        return {}

    def service(self, name: str) -> Service | None:
        """Return what answers calls of this service; None: not this family."""
        return None

    def services(self) -> Mapping[str, str]:
        """Return the services that this family answers, with their types, as rosapi lists them."""
        return {}

    def actions(self) -> Iterable[str]:
        """Return the actions that clients offer, as rosapi lists them."""
        return ()

    def publisher(self, topic: str) -> Handler | None:
        """Return what takes messages that the client publishes on this topic; None: not this family."""
        return None

    async def show(self, topic: str, message: Mapping[str, Any]) -> bool:
        """Send a message of the console's own, or of another client.

        Return False if the client does not subscribe to this topic here, or reads too slowly.
        """
        return False

    async def subscribed(self, topic: str) -> None:
        """The client has subscribed to this topic."""

    def control_changed(self, control: Control) -> None:
        """Control of the robot changed, or who may take it."""

    def leave(self) -> None:
        """End everything: the client is gone."""
