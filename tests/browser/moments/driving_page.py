"""A driving page in Chromium without a console: Django answers in this process, and a moment has the messages."""

from __future__ import annotations

import itertools
import json
import re
import time
from mimetypes import guess_type
from typing import Any
from urllib.parse import urlsplit

import msgspec
from django.contrib.staticfiles import finders
from django.test import Client
from playwright.sync_api import Page, Route, WebSocketRoute

from robots.shared import wire
from tests.browser.moments.scenes import MOTIONS, Moment, camera_frame, scan

ORIGIN = "http://testserver"
NAME = "Olga Operator"
# A person who has used the console before, and drives by the camera.
CHOICES = (
    """localStorage.setItem("fleet-console", '{"camera-view": "camera", "hints_seen operator": true}')"""
)
LISTS = json.dumps(
    {
        "phrases": [{"id": 1, "text": "Hello, I am TIAGo.", "language": "en", "tags": []}],
        "robots": [{"slug": "tiago-9", "name": "TIAGo Nine", "profile": "tiago", "enabled": True}],
        "maps": [],
        "layouts": [{"number": 1, "name": "Survey", "cells": ["map", "camera"], "side": False}],
    }
).encode()


def pages_of(client: Client, address: str) -> dict[str, tuple[str, bytes]]:
    """Return a page and its own scripts outside /static/: content types and bodies, by path."""
    page = client.get(address)
    scripts = re.findall(r'<script[^>]* src="(/(?!static)[^"]+)"', page.content.decode())
    found = {address: page} | {urlsplit(path).path: client.get(path) for path in scripts}
    return {path: (answer["Content-Type"], answer.content) for path, answer in found.items()}


class DrivingPage:
    """The driving page of one robot. `show` brings it to a moment; then the window's size and theme may change."""

    def __init__(self, page: Page, client: Client, facts: wire.RobotFacts) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.heard: list[dict[str, Any]] = []  # by the console, from the page
        self._pages = pages_of(client, f"/robots/{facts.slug}/")
        self._facts = msgspec.structs.replace(
            facts, cameras=[wire.CameraEntry("head", "Head camera", True)], has_head=True, has_map=True
        )
        self._moment = Moment("none")
        self._begun_s = time.monotonic()
        self._socket: WebSocketRoute | None = None  # of the control page
        self._cut: Moment | None = None  # the moment whose socket was closed
        self._pictures = 0
        page.add_init_script(CHOICES)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.route("**/*", self._answer)
        page.route_web_socket(re.compile("/ws/robots/[^/]+/$"), self._control)
        page.route_web_socket(re.compile("/ws/robots/[^/]+/topics/$"), self._topics)
        page.route_web_socket(re.compile("/ws/robots/[^/]+/camera/$"), self._camera)
        page.route_web_socket(re.compile("/ws/news/$"), lambda _silent: None)

    def show(self, moment: Moment) -> None:
        """Open the page, and bring it to a moment."""
        self._moment = moment
        self._pictures = 0
        self.page.goto(f"{ORIGIN}/robots/{self._facts.slug}/")
        self.page.wait_for_function(
            "document.querySelector('[data-part=who]').textContent !== 'Control is not known'"
        )
        self.page.wait_for_function("document.querySelector('.camera-words').hidden")  # a picture came
        if moment.mapped:
            self.page.locator("[data-part=map-open]").click()
        self._go_on(moment)
        if moment.keys:
            self.page.keyboard.down(moment.keys)
        if moment.points:
            floor = self.page.locator("[data-part=camera-floor]")
            box = floor.bounding_box()
            assert box is not None
            floor.click(position={"x": 0.4 * box["width"], "y": 0.8 * box["height"]})
            self.page.locator("[data-part=there-offer]").wait_for()
        self.page.wait_for_timeout(
            600
        )  # nothing tells when a page has settled; a stale world is stale by then

    def _go_on(self, moment: Moment) -> None:
        assert self._socket is not None
        if moment.cut:
            self._cut = moment
            self._socket.close(code=1011)
        elif moment.gone:
            self._say(self._socket, moment.gone)

    # --- the console's side ----------------------------------------------------------------------

    def _answer(self, route: Route) -> None:
        url = urlsplit(route.request.url)
        if url.path.startswith("/static/"):
            found = finders.find(url.path.removeprefix("/static/"))
            if found is None:
                return route.fulfill(status=404)
            return route.fulfill(path=str(found), content_type=guess_type(str(found))[0] or "text/plain")
        kind, body = self._pages.get(url.path, ("application/json", LISTS))
        return route.fulfill(content_type=kind, body=body)

    def _control(self, socket: WebSocketRoute) -> None:
        moment = self._moment
        if moment is self._cut:
            socket.close(code=1011)
            return
        self._socket = socket

        def heard(text: str | bytes) -> None:
            message = json.loads(text)
            self.heard.append(message)
            if message["t"] == "hello":
                self._say(socket, wire.Welcome(wire.PROTOCOL, NAME, "operator", self._facts))
                self._say(socket, moment.control)
                self._say(socket, wire.Offers(motions=MOTIONS, languages=["en"]))
                if moment.before:
                    self._say(socket, wire.View(self._of(moment.before), scan()))
                self._say(socket, wire.View(self._of(moment.state), scan()))
            elif moment.silent or moment.gone:
                return
            elif message["t"] == "ping":
                self._say(socket, wire.Pong(message["sent_ms"]))
            elif message["t"] == "ack":
                self._say(socket, wire.View(self._of(moment.state), scan()))

        socket.on_message(heard)

    def _of(self, state: wire.State) -> wire.State:
        mine = self._moment.control.state == "yours"
        return msgspec.structs.replace(state, fence=7 if mine else None, holder=NAME if mine else None)

    def _camera(self, socket: WebSocketRoute) -> None:
        def heard(text: str | bytes) -> None:
            message = json.loads(text)
            if message["t"] == "ping":
                self._say(socket, wire.CameraPong(message["sent_ms"], self._now_ms))
            elif message["t"] in ("camera_watch", "camera_ack") and not (self._pictures and self._is_frozen):
                self._pictures += 1
                socket.send(camera_frame(self._pictures, self._now_ms))

        socket.on_message(heard)
        self._say(socket, wire.Cameras(self._facts.cameras))

    def _topics(self, socket: WebSocketRoute) -> None:
        """One topic; a message comes for each that the page has shown."""
        numbers = itertools.count(1)

        def heard(text: str | bytes) -> None:
            message = json.loads(text)
            if message["t"] == "topics":
                topics = [{"name": "/odom", "type": "nav_msgs/Odometry"}]
                answer = {"t": "graph", "topics": topics, "actions": [], "services": []}
                socket.send(json.dumps({**answer, "seq": message["seq"]}))
            elif message["t"] in ("subscribe", "ack"):
                sample = {"t": "sample", "topic": "/odom", "fields": {"x": self._now_ms % 1000}}
                socket.send(json.dumps({**sample, "number": next(numbers)}))

        socket.on_message(heard)

    @property
    def _is_frozen(self) -> bool:
        moment = self._moment
        return bool(moment.silent or moment.gone or moment.cut or moment.state.unseen_s)

    @property
    def _now_ms(self) -> float:
        return 1000.0 * (time.monotonic() - self._begun_s)

    @staticmethod
    def _say(socket: WebSocketRoute, message: Any) -> None:
        socket.send(wire.encode(message).decode())
