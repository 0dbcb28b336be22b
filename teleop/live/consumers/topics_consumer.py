"""The WebSocket of a robot's topics, for the topics tab and for programs."""

from __future__ import annotations

import time
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.wire import NotDone, Refusal, Refused, TopicQuery, kind_of, topics_message
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import BUSY
from teleop.live.consumers.robot_socket import RobotSocket
from teleop.live.service_calls import ServiceCall, execute
from teleop.live.topic_feed import SampleWithheld, TopicViewer
from teleop.records.camera_audit import TOO_MANY_CAMERAS, CameraAudit

MAX_PENDING = 8  # queries per connection
QUERIES_PER_S = 5.0  # an answer may be large, and is not acknowledged
QUERIES_BURST = 30.0


class TopicsConsumer(RobotSocket):
    """One connection to one robot's topics: its queries and its subscriptions."""

    through = "topics"
    checked_often = True  # it shows the robot's messages themselves

    def __init__(self) -> None:
        super().__init__()
        self.viewer: TopicViewer | None = None
        self.camera_audit: CameraAudit | None = None
        self._pending = 0
        self._query_budget = TokenBucket(QUERIES_PER_S, QUERIES_BURST)

    async def on_open(self) -> None:
        """Join the robot's hub, if this person may see the robot."""
        entry = await self.join(Scope.TOPICS)
        if entry is not None:
            self.camera_audit = CameraAudit(self.user, self.robot_id, entry.facts.name)
            self.viewer = TopicViewer(self.hub.topics, self._show)
            await self.hub.wait_for_link()
            self.report_bridge_gone()

    async def on_close(self) -> None:
        """End all subscriptions; a running service call is still recorded."""
        self._end_subscriptions()
        if self.joined:
            await self.hub.remove(self)

    async def revoke_access(self, refusal: Refusal) -> None:
        """End all subscriptions and close: this person may not see the robot any more."""
        self._end_subscriptions()
        await super().revoke_access(refusal)

    def _end_subscriptions(self) -> None:
        if self.viewer:
            self.viewer.leave()
        if self.camera_audit:
            self.camera_audit.end_all()

    async def _show(self, event: dict[str, Any]) -> None:
        if self.camera_audit and not self.camera_audit.begin_if_picture(event["text"]):
            await self.send_refusal("subscribe", TOO_MANY_CAMERAS)
            raise SampleWithheld
        await self.asgi_send(event)

    # --- messages ----------------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        message = topics_message(raw)
        if self.viewer is None or not await self.within_budget(kind_of(message)):
            return
        match message:
            case wire.Subscribe(topic=topic, rate_hz=rate_hz):
                refusal = self.viewer.subscribe(topic, rate_hz)
                if refusal is not None:
                    await self.send_refusal("subscribe", refusal)
            case wire.Unsubscribe(topic=topic):
                self.viewer.unsubscribe(topic)
                if self.camera_audit:
                    self.camera_audit.end_viewing(topic)
            case wire.Ack():
                self.viewer.acknowledge()
            case wire.Ping(sent_ms=sent_ms):
                await self.send_message(wire.Pong(sent_ms))
            case query if self._pending < MAX_PENDING and self._query_budget.spend(time.monotonic()):
                self._pending += 1
                run_in_background(self._answer(query))
            case query:
                await self.send_refusal(kind_of(query), BUSY, query.seq)

    async def _answer(self, query: TopicQuery) -> None:
        try:
            await self.send_encoded(await self._ask(query))
        except NotDone as refused:
            await self.answer(Refused(kind_of(query), refused.refusal, query.seq))
        finally:
            self._pending -= 1

    async def _ask(self, query: TopicQuery) -> str:
        if isinstance(query, ServiceCall):
            return await execute(query, hub=self.hub, user=self.user, rights=self.rights)
        return await self.hub.link.query_topics(query, person=self.user.pk)
