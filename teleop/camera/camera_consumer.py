"""The WebSocket of a robot's cameras: separate from control, so that no picture delays drive input or a stop."""

from __future__ import annotations

import asyncio
import time

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import CameraState, Refusal, camera_message, kind_of
from teleop.background.jobs import run_in_background
from teleop.camera.feed import CameraFeed, CameraViewer, feed_of
from teleop.control.status import RobotEntry
from teleop.live.consumers.robot_socket import RobotSocket
from teleop.records.camera_audit import TOO_MANY_CAMERAS, CameraAudit

WATCHES_WITHIN_S = 10.0  # from opening this connection until a page that shows a camera requests it


class CameraConsumer(RobotSocket):
    """One connection to one robot's cameras."""

    through = "cameras"
    checked_often = True  # pictures must end within a second after the right to see them ends

    def __init__(self) -> None:
        super().__init__()
        self.camera_audit: CameraAudit | None = None
        self._viewers: dict[str, CameraViewer] = {}
        # The feed whose camera process runs for this connection, which watches no camera yet.
        self._kept_feed: CameraFeed | None = None

    async def on_open(self) -> None:
        """Join the robot's hub, if this person may see the robot. The camera process starts while the page loads."""
        entry = await self.join(Scope.TOPICS)
        if entry is not None:
            self.camera_audit = CameraAudit(self.user, self.robot_id, entry.facts.name)
            self._start_process()
            await self._send_cameras(entry)

    async def on_close(self) -> None:
        """End all viewings, and leave the robot's hub."""
        self._end_all()
        if self.joined:
            await self.hub.remove(self)

    async def revoke_access(self, refusal: Refusal) -> None:
        """End all viewings and close: this person may not see the robot any more."""
        self._end_all()
        self.camera_audit = None  # no viewing can begin any more
        await super().revoke_access(refusal)

    async def robot_edited(self, entry: RobotEntry) -> None:
        """Send the page the robot's cameras. End viewings of removed cameras, and move the others to a new link."""
        await self._send_cameras(entry)
        for camera, viewer in list(self._viewers.items()):
            if not self._has(camera):
                self._end(camera)
            elif viewer.feed is not None and viewer.feed.link is not self.hub.link:
                self._begin(viewer.watch)

    # --- messages ----------------------------------------------------------------------------------

    async def on_message(self, raw: str) -> None:
        message = camera_message(raw)
        if not self.joined or not await self.within_budget(kind_of(message)):
            return
        match message:
            case wire.CameraWatch(camera=camera):
                if self._has(camera):
                    self._begin(message)
                else:
                    await self.send_refusal(kind_of(message), _no_camera(camera))
            case wire.CameraEnd(camera=camera):
                self._end(camera)
            case wire.CameraAck():
                self._acknowledge(message)
            case wire.Ping(sent_ms=sent_ms):
                now_ms = round(time.monotonic() * 1000.0, 3)
                await self.send_encoded(wire.encode(wire.CameraPong(sent_ms, now_ms)).decode())

    def _acknowledge(self, message: wire.CameraAck) -> None:
        viewer = self._viewers.get(message.camera)
        if viewer is not None and viewer.feed is not None:
            viewer.acknowledge(message.number, message.damaged)
            viewer.feed.acknowledged(viewer)

    def _has(self, camera: str) -> bool:
        return any(camera == entry.name for entry in self.hub.entry.facts.cameras)

    def _begin(self, watch: wire.CameraWatch) -> None:
        """Start to watch a camera, or change how it is watched."""
        before = self._viewers.get(watch.camera)
        if self.camera_audit is None:
            return
        viewer = self._viewers[watch.camera] = CameraViewer(watch, self._show, self._state)
        feed_of(self.hub.link).add(viewer)
        self._end_start()
        if before is not None and before.feed is not None:
            before.feed.remove(before)

    def _end(self, camera: str) -> None:
        viewer = self._viewers.pop(camera, None)
        if viewer is not None and viewer.feed is not None:
            viewer.feed.remove(viewer)
        if self.camera_audit is not None:
            self.camera_audit.end_viewing(camera)

    def _end_all(self) -> None:
        for camera in list(self._viewers):
            self._end(camera)
        self._end_start()

    def _start_process(self) -> None:
        """Start the camera process before the page requests a camera. Stop waiting after `WATCHES_WITHIN_S`."""
        if self.hub.entry.facts.cameras:
            self._kept_feed = feed_of(self.hub.link)
            self._kept_feed.keep_ready(self)
            asyncio.get_running_loop().call_later(WATCHES_WITHIN_S, self._end_start)

    def _end_start(self) -> None:
        """Undo `_start_process`. The camera process goes on only while a connection watches a camera."""
        kept, self._kept_feed = self._kept_feed, None
        if kept is not None:
            kept.release(self)

    async def _send_cameras(self, entry: RobotEntry) -> None:
        await self.send_encoded(wire.encode(wire.Cameras(entry.facts.cameras)).decode())

    # --- pictures ----------------------------------------------------------------------------------

    async def _show(self, camera: str, frame: bytes) -> bool:
        """Send a picture if its viewing can be recorded. Return whether it was sent."""
        if self._closing or self.camera_audit is None:
            return False
        viewer = self._viewers.get(camera)
        if viewer is None:  # the viewing has ended
            return False
        if not self.camera_audit.begin_or_continue(camera, small=viewer.watch.size == "small"):
            await self.send_refusal("camera_watch", TOO_MANY_CAMERAS)
            return False
        await self.send_bytes(frame)
        return True

    def _state(self, state: CameraState) -> None:
        run_in_background(self.send_encoded(wire.encode(state).decode()))


def _no_camera(camera: str) -> Refusal:
    text = say("This robot has no camera “{camera}”.", camera=camera)
    return Refusal("no_camera", text, "robot", {"camera": camera})
