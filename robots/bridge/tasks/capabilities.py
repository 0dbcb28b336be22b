"""The robot's capabilities besides driving. Pages get them on connecting, on change and on request."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robots import wire
from robots.bridge.config import BridgeConfig
from robots.bridge.tasks.input_routing import InputRouting


class Capabilities:
    """The newest offers of one robot. `announce` hands them to every link."""

    def __init__(
        self, config: BridgeConfig, routing: InputRouting, announce: Callable[[wire.Offers], None]
    ) -> None:
        self._languages = config.topics.languages if config.topics.speech else []
        publishable = [allowed for allowed in config.allowed if allowed.what == "publish"]
        self._publishable = {allowed.name: allowed.type for allowed in publishable}
        self._publishable_from = {allowed.name: allowed.role for allowed in publishable}
        self._routing = routing
        self._announce = announce
        self._motions: dict[str, tuple[Sequence[wire.MotionOffer], str]] = {}  # by action
        self._asked = False
        self._told = self.now()

    def asked(self) -> None:
        """Somebody wants to hear it, also if nothing has changed, once it was read again."""
        self._asked = True

    def read(self, action: str, motions: Sequence[wire.MotionOffer], text: str) -> None:
        """The motions that an action of the robot's offers; why there is none."""
        self._motions[action] = (motions, text)
        self.tell(self._asked)
        self._asked = False

    def title_of(self, motion: str, action: str) -> str:
        """Title of a motion for people; its name if there is no title."""
        motions, _ = self._motions.get(action, ((), ""))
        return next((offer.title for offer in motions if offer.name == motion), motion)

    def tell(self, anyway: bool = False) -> None:
        """Tell what is on offer, if it has changed or `anyway`."""
        offers = self.now()
        if anyway or offers != self._told:
            self._told = offers
            self._announce(offers)

    def now(self) -> wire.Offers:
        """The present capabilities."""
        uses = self._routing.uses
        motions: Sequence[wire.MotionOffer] = ()
        text = "This robot has no recorded motions."
        if "motions" in uses:
            not_read = ((), "The robot’s motions have not been read yet.")
            motions, text = self._motions.get(self._routing.topic("motions"), not_read)
        return wire.Offers(
            list(motions), text, self._languages, uses, self._publishable, self._publishable_from
        )
