"""Capabilities of the robot. They are sent to a page when it connects, when they change, and on request."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robots.bridge.tasks.input_routing import InputRouting
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.sentences import say


class Capabilities:
    """The newest capabilities of one robot. `announce` sends them to every link."""

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
        self._reported = self.now()

    def request_report(self) -> None:
        """Send the capabilities after the next read, even if they are unchanged: somebody asked."""
        self._asked = True

    def read(self, action: str, motions: Sequence[wire.MotionOffer], text: str) -> None:
        """Take the motions that an action offers, or `text` why there are none."""
        self._motions[action] = (motions, text)
        self.report(self._asked)
        self._asked = False

    def title_of(self, motion: str, action: str) -> str:
        """Return the title of an action's motion; its name, if no title is known."""
        motions, _ = self._motions.get(action, ((), ""))
        return next((offer.title for offer in motions if offer.name == motion), motion)

    def report(self, anyway: bool = False) -> None:
        """Send the capabilities if they have changed, or if `anyway`."""
        offers = self.now()
        if anyway or offers != self._reported:
            self._reported = offers
            self._announce(offers)

    def now(self) -> wire.Offers:
        """Return the present capabilities."""
        uses = self._routing.uses
        motions: Sequence[wire.MotionOffer] = ()
        text: str = say("This robot has no recorded motions.")
        if "motions" in uses:
            not_read = ((), say("The robot’s motions have not been read yet."))
            motions, text = self._motions.get(self._routing.topic("motions"), not_read)
        return wire.Offers(
            list(motions), text, self._languages, uses, self._publishable, self._publishable_from
        )
