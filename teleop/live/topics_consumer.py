"""The robot's topics, live: for the topics tab, and for applications."""

from __future__ import annotations

import time
from typing import Any

from robots import wire
from robots.bridge.server.flood_limits import Budget
from robots.wire import NotDone, Refusal, Refused, TopicQuery, kind_of, topics_message
from teleop.background.tasks import run_in_background
from teleop.live import robot_hub
from teleop.live.robot_socket import RobotSocket
from teleop.live.service_calls import Call, execute
from teleop.live.tasks import BUSY
from teleop.live.topic_feed import TopicViewer, Withheld
from teleop.recording.camera_audit import CameraAudit

MAX_PENDING = 8  # questions of one connection
QUESTIONS_PER_S = 5.0  # an answer may be large, and nobody knows whether the last was read
QUESTIONS_BURST = 30.0
WATCHED_OFTEN = Refusal(
    "busy", "You have begun to watch cameras very often: this one is shown in a moment.", "audit"
)


class TopicsConsumer(RobotSocket):
    """One connection that looks at one robot's topics: its questions, its live views."""

    through = "topics"
    checked_often = True  # what it sees are the robot's messages themselves

    def __init__(self) -> None:
        super().__init__()
        self.viewer: TopicViewer | None = None
        self.camera_audit: CameraAudit | None = None
        self._under_way = 0
        self._questions = Budget(QUESTIONS_PER_S, QUESTIONS_BURST)

    async def on_open(self) -> None:
        """Let this person in, if they may look at the robot."""
        entry = await self.find_robot()
        if entry is not None:
            self.hub = robot_hub.join(self.robot_id, entry, self)
            self.camera_audit = CameraAudit(self.user, self.robot_id, entry.facts.name)
            self.viewer = TopicViewer(self.hub.topics, self._show)
            await self.hub.wait_for_link()
            self.report_bridge_gone()

    async def on_close(self) -> None:
        """Look no more; a call that is under way goes on record all the same."""
        self._look_away()
        if self.joined:
            await self.hub.remove(self)

    async def revoke_access(self, refusal: Refusal) -> None:
        """This person may not look any more."""
        self._look_away()
        await super().revoke_access(refusal)

    def _look_away(self) -> None:
        if self.viewer:
            self.viewer.leave()
        if self.camera_audit:
            self.camera_audit.end_all()

    async def _show(self, event: dict[str, Any]) -> None:
        if self.camera_audit and not self.camera_audit.shown(event["text"]):
            await self.refuse("look", WATCHED_OFTEN)
            raise Withheld
        await self.asgi_send(event)

    # --- what is asked -----------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        """One message."""
        message = topics_message(raw)
        if self.viewer is None or not await self.within_budget(kind_of(message)):
            return
        match message:
            case wire.Subscribe(topic=topic, rate_hz=rate_hz):
                refusal = self.viewer.subscribe(topic, rate_hz)
                if refusal is not None:
                    await self.refuse("look", refusal)
            case wire.Unsubscribe(topic=topic):
                self.viewer.unsubscribe(topic)
                if self.camera_audit:
                    self.camera_audit.end(topic)
            case wire.Ack():
                self.viewer.acknowledge()
            case wire.Ping(sent_ms=sent_ms):
                await self.send_message(wire.Pong(sent_ms))
            case question if self._under_way < MAX_PENDING and self._questions.spend(time.monotonic()):
                self._under_way += 1
                run_in_background(self._answer(question))
            case question:
                await self.refuse(kind_of(question), BUSY, question.seq)

    async def _answer(self, question: TopicQuery) -> None:
        try:
            await self.send_encoded(await self._found_out(question))
        except NotDone as refused:
            await self.answer(Refused(kind_of(question), refused.refusal, question.seq))
        finally:
            self._under_way -= 1

    async def _found_out(self, question: TopicQuery) -> str:
        if isinstance(question, Call):
            return await execute(question, hub=self.hub, user=self.user, rights=self.rights)
        return await self.hub.link.ask(question)
