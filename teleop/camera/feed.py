"""The newest pictures of one robot's cameras in this web process, and their viewers.

The camera process encodes each variant once. This module adds one header for all viewers. Pictures are never
queued: a viewer that is not ready gets a newer picture later.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from itertools import count
from typing import NamedTuple
from uuid import UUID

from robots.link.camera_link import STARTING, CameraLink
from robots.link.client import BridgeLink
from robots.shared import wire
from robots.shared.wire import (
    CameraState,
    CameraWants,
    CameraWatch,
    PictureHeader,
    Refusal,
    TakenPicture,
    Variant,
)
from teleop.camera.variant_choice import Quality

log = logging.getLogger(__name__)

_numbers = count(1)  # numbers of pictures on pages: they also grow if a page watches the same camera again

KEY_PAUSE_S = 0.5  # between two requests for a key picture
DECIDE_S = 0.5
STALLED_S = 5.0  # if a viewer acknowledges nothing for this time, no pictures are requested for it
YIELD_S = 0.0005  # drive input waits at most for this time plus the sending of one picture

Send = Callable[[str, bytes], Awaitable[bool]]  # camera and frame; returns False if the picture was not sent


class _Newest(NamedTuple):
    number: int  # number of the picture on pages
    made: int  # number by the camera process: consecutive for each variant
    key: bool
    frame: bytes


class CameraViewer:
    """One connection that watches one camera. `send` sends a picture; `state` sends the reason if there are none."""

    def __init__(self, watch: CameraWatch, send: Send, state: Callable[[CameraState], None]) -> None:
        self.watch = watch
        self.camera = watch.camera
        self.feed: CameraFeed | None = None  # None until a feed adds this viewer
        self.state = state
        self.quality = Quality(watch.size, watch.video, watch.rate_hz, time.monotonic())
        self.rate_hz = watch.rate_hz
        self._send = send
        self._unacknowledged: dict[int, float] = {}
        self._sent: _Newest | None = None  # the picture that was sent last
        self._due_s = 0.0
        self._broken = True  # video: an earlier picture is missing, so the next ones cannot be decoded

    def acknowledge(self, number: int, damaged: bool = False) -> None:
        """Note that the page has painted or dropped this picture and all earlier ones.

        `damaged`: the page could not decode the picture, and decodes no video until the next key picture.
        """
        self._broken |= damaged
        now_s = time.monotonic()
        self.quality.painted(damaged=damaged)
        for earlier in [waiting for waiting in self._unacknowledged if waiting <= number]:
            sent_s = self._unacknowledged.pop(earlier)
            self.quality.acknowledged(now_s, sent_s)

    def decide(self, now_s: float) -> bool:
        """Choose the variant for this viewer; return whether the variant changed."""
        for sent_s in self._unacknowledged.values():
            self.quality.unacknowledged(now_s, sent_s)
        changed = self.quality.decide(now_s)
        if changed:
            self.begin_anew()
        return changed

    def is_stalled(self, now_s: float) -> bool:
        """Return whether no more picture may be sent, and the last one was sent more than `STALLED_S` ago."""
        waits = list(self._unacknowledged.values())
        return len(waits) >= self.quality.most_unacknowledged and now_s - waits[-1] > STALLED_S

    def lacks(self, newest: _Newest | None) -> bool:
        """Return whether there is a newest picture that was not sent to this viewer."""
        return newest is not None and newest is not self._sent

    def begin_anew(self) -> None:
        """Forget the last picture: the next one cannot continue its video."""
        self._broken = True
        self._sent = None

    def is_due(self, newest: _Newest, now_s: float) -> bool:
        """Return whether to send this picture now. After a missed video picture, only a key picture can follow."""
        if newest is self._sent:
            return False
        has_room = len(self._unacknowledged) < self.quality.most_unacknowledged
        if self.quality.variant != "video":
            return has_room and now_s >= self._due_s
        if newest.key:
            self._broken = False
        elif self._sent is None or newest.made != self._sent.made + 1:
            self._broken = True
        if not has_room:
            self._broken = True
        return not self._broken

    @property
    def needs_key(self) -> bool:
        """Return whether the video needs a key picture to continue, and the viewer has room for a picture."""
        return (
            self.quality.variant == "video"
            and self._broken
            and len(self._unacknowledged) < self.quality.most_unacknowledged
        )

    async def show(self, newest: _Newest, now_s: float) -> None:
        """Send this picture."""
        self._sent = newest
        self._due_s = now_s + 0.8 / self.rate_hz
        self._unacknowledged[newest.number] = now_s
        if not await self._send(self.camera, newest.frame):
            self._unacknowledged.pop(newest.number, None)


class CameraFeed:
    """All watched cameras of one robot. `feed_of` creates it. It ends if no viewer and no waiting page is left."""

    def __init__(self, link: BridgeLink) -> None:
        self.link = link
        self._camera_link = CameraLink(link, self)
        self._viewers: set[CameraViewer] = set()
        self._waiting: set[object] = set()  # connections that will watch in a moment
        self._stalled: set[CameraViewer] = set()
        self._newest: dict[tuple[str, Variant], _Newest] = {}
        self._states: dict[str, CameraState] = {}
        self._key_asked_s: dict[str, float] = {}
        self._gone: Refusal | None = STARTING
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._keep_sending())

    # --- viewers -----------------------------------------------------------------------------------

    def keep_ready(self, connection: object) -> None:
        """Let the camera process start: this connection will soon watch a camera. `release` undoes this."""
        self._waiting.add(connection)

    def release(self, connection: object) -> None:
        """Note that this connection needs the camera process only for the cameras that it watches."""
        self._waiting.discard(connection)
        self._end_if_unused()

    def add(self, viewer: CameraViewer) -> None:
        """Show a camera to one more connection."""
        viewer.feed = self
        self._viewers.add(viewer)
        self._send_wants()
        if self._gone is not None:
            viewer.state(CameraState(viewer.camera, self._gone))
        elif state := self._states.get(viewer.camera):
            viewer.state(state)
        self._news.set()

    def remove(self, viewer: CameraViewer) -> None:
        """Remove a viewer. Must not wait: the robot's hub calls it while it informs all pages."""
        self._viewers.discard(viewer)
        self._stalled.discard(viewer)
        self._send_wants()
        self._end_if_unused()

    def _end_if_unused(self) -> None:
        if self._viewers or self._waiting:
            return
        if _feeds.get(self.link.robot_id) is self:
            del _feeds[self.link.robot_id]
        self._task.cancel()
        self._camera_link.close()

    def acknowledged(self, viewer: CameraViewer) -> None:
        """Note that this viewer may be ready for its next picture. If there is one, wake the sending task."""
        if viewer.quality.has_failed:
            self._decide(time.monotonic())
        if viewer in self._stalled:
            self._stalled.discard(viewer)
            self._send_wants()
        if viewer.needs_key or viewer.lacks(self._newest_for(viewer)):
            self._news.set()

    def _newest_for(self, viewer: CameraViewer) -> _Newest | None:
        return self._newest.get((viewer.camera, viewer.quality.variant))

    def _send_wants(self) -> None:
        wants: dict[str, dict[Variant, float]] = {}
        for viewer in self._viewers - self._stalled:
            variants = wants.setdefault(viewer.camera, {})
            variant = viewer.quality.variant
            variants[variant] = max(viewer.rate_hz, variants.get(variant, 0.0))
        self._newest = {
            key: newest for key, newest in self._newest.items() if key[1] in wants.get(key[0], {})
        }
        self._camera_link.set_wants(CameraWants(wants))

    # --- pictures (robots.link.camera_link.PictureListener) -------------------------------------------

    def on_picture(self, header: TakenPicture, encoded: memoryview) -> None:
        """Make this the newest picture of its camera and variant."""
        self._gone = None
        now_s = time.monotonic()
        number = next(_numbers)
        shown = PictureHeader(
            header.camera,
            number,
            header.format,
            header.width,
            header.height,
            round(max(now_s - header.age_s, 0.0) * 1000.0, 1),
            header.key,
            header.lens,
            header.pose,
            header.scale,
        )
        frame = wire.packed(shown, encoded)
        self._newest[header.camera, header.variant] = _Newest(number, header.number, header.key, frame)
        for viewer in self._viewers:
            if (viewer.camera, viewer.quality.variant) == (header.camera, header.variant):
                viewer.quality.offered(now_s)
        self._news.set()

    def on_camera_state(self, state: CameraState) -> None:
        """Send the state to the camera's viewers."""
        self._gone = None
        self._states[state.camera] = state
        for viewer in self._viewers:
            if viewer.camera == state.camera:
                viewer.state(state)

    def on_cameras_gone(self, refusal: Refusal) -> None:
        """Send the reason to all viewers. Old pictures are not shown again."""
        self._newest.clear()
        self._states.clear()
        if refusal != self._gone:
            self._gone = refusal
            for viewer in self._viewers:
                viewer.begin_anew()
                viewer.state(CameraState(viewer.camera, refusal))

    async def _keep_sending(self) -> None:
        decided_s = time.monotonic()
        while True:
            # Not `wait_for`: before Python 3.12, it may lose a cancellation.
            alarm = asyncio.get_running_loop().call_later(DECIDE_S, self._news.set)
            await self._news.wait()
            alarm.cancel()
            self._news.clear()
            now_s = time.monotonic()
            if now_s - decided_s >= DECIDE_S:
                decided_s = now_s
                self._decide(now_s)
            began_s = now_s
            for viewer in list(self._viewers):
                await self._show(viewer)
                if time.monotonic() - began_s > YIELD_S:
                    await asyncio.sleep(0)  # handle drive input that has arrived since
                    began_s = time.monotonic()

    async def _show(self, viewer: CameraViewer) -> None:
        now_s = time.monotonic()
        newest = self._newest_for(viewer)
        if newest is not None and viewer in self._viewers and viewer.is_due(newest, now_s):
            try:
                await viewer.show(newest, now_s)
            except OSError:
                return  # the connection is gone; its consumer detects this itself
            except Exception:
                log.exception("A camera picture was not sent.")
        if viewer.needs_key and now_s - self._key_asked_s.get(viewer.camera, 0.0) > KEY_PAUSE_S:
            self._key_asked_s[viewer.camera] = now_s
            self._camera_link.require_key(viewer.camera)

    def _decide(self, now_s: float) -> None:
        changed = [viewer for viewer in self._viewers if viewer.decide(now_s)]
        stalled = {viewer for viewer in self._viewers if viewer.is_stalled(now_s)}
        if changed or stalled != self._stalled:
            self._stalled = stalled
            self._send_wants()


_feeds: dict[UUID, CameraFeed] = {}


def feed_of(link: BridgeLink) -> CameraFeed:
    """Return the robot's feed in this web process; a robot with a new link gets a new feed."""
    feed = _feeds.get(link.robot_id)
    if feed is None or feed.link is not link:
        feed = _feeds[link.robot_id] = CameraFeed(link)
    return feed
