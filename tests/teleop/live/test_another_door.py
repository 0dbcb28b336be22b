"""A door with a protocol of its own: the chain serves it as it serves pages, and knows nothing of it."""

import pytest
from channels.routing import URLRouter
from django.urls import path

from fleet.site.websocket_handshake import guarded
from robots.shared import wire
from teleop.live.consumers.controlling_socket import ControllingSocket
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)


class Words(ControllingSocket):
    """Takes words: take, go, say TEXT, stop. Answers with codes."""

    through = "words"

    async def on_open(self):
        if await self.join() is not None:
            self.prepare()
            self.begin_control("words-0123456789-01")
            await self.hub.read_status_for(self)

    async def on_message(self, raw):
        word, _, text = raw.partition(" ")
        match word:
            case "take":
                self.requests.add(self.control.take_control)
            case "go":
                await self.hub.link.forward(
                    wire.encode(wire.Drive(self.fence, 1, 5.0, x=0.5, w=0.0)).decode()
                )
            case "say":
                await self.tasks.start(wire.Say(self.fence or 1, text, "en"))
            case "stop":
                self.stop_button.press(self.hub.link)

    async def send_message(self, message):
        match message:
            case wire.Refused(refusal=refusal):
                await self.send_encoded(f'"{refusal.code}"')
            case wire.Accepted(of=of):
                await self.send_encoded(f'"{of} accepted"')
            case wire.Control(state=state):
                await self.send_encoded(f'"{state}"')


@pytest.fixture
async def door(robot, browsers, websocket_headers, bridge):
    """The operator's connection."""
    page = Page(websocket_headers(browsers["operator"]), f"/words/{robot.slug}/")
    page._socket.application = guarded(URLRouter([path("words/<slug:slug>/", Words.as_asgi())]))
    yield await page.open()
    await page.close()


async def hears(door, word):
    while await door._message() != word:
        pass


async def test_control_drive_task_and_stop(door, bridge):
    await door.say_raw("say Hello")
    await hears(door, "no_lease")
    await door.say_raw("take")
    await hears(door, "yours")
    await door.say_raw("go")
    assert (await bridge.hears(wire.Drive)).fence == 1
    await door.say_raw("say Hello")
    await hears(door, "say accepted")
    await door.say_raw("stop")
    assert (await bridge.hears(wire.LinkStop)).by == "Olga Operator"
