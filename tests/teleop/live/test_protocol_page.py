"""The protocol page documents every message, and its example program works."""

import asyncio
import re
import sys
from pathlib import Path
from typing import get_args

import pytest
from websockets.asyncio.server import serve

from robots.shared import wire
from script.generate import messages

PAGE = (Path(__file__).parents[3] / "docs" / "protocol.md").read_text()


@pytest.mark.parametrize(
    "kinds",
    [
        {*get_args(wire.BrowserMessage)} - {*get_args(wire.TaskRequest)},  # the generated page explains tasks
        get_args(wire.FleetMessage),
        get_args(wire.TopicsMessage),
        get_args(wire.BrowserReport),
        get_args(wire.TopicsReport),
        get_args(wire.FleetReport),
    ],
)
def test_every_message_of_a_page_is_explained(kinds):
    tags = {kind.__struct_config__.tag for kind in kinds}
    assert {tag for tag in tags if f"`{tag}`" not in PAGE} == set()


def test_reference_matches_the_messages():
    assert messages.PAGE.read_text() == messages.page(), "run script/messages"


def test_every_rule_has_a_row_of_its_codes():
    assert [rule for rule in get_args(wire.Rule) if f"| {rule} | `" not in PAGE] == []


async def test_example_prints_and_acknowledges_samples():
    [program] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    heard = []

    async def console(socket):
        heard.append((socket.request.path, socket.request.headers["Authorization"]))
        heard.append(wire.topics_message(await socket.recv()))
        for number in (1, 2):
            fields = {"pose": {"pose": {"position": {"x": number}}}}
            shown = wire.Sample("/odom", "nav_msgs/Odometry", number, 5.0, 700, 0.01, 1, fields)
            await socket.send(wire.encode(shown), text=True)
            heard.append(wire.topics_message(await socket.recv()))
        refusal = wire.Refusal("bridge_down", "The bridge is not running.", "robot")
        await socket.send(wire.encode(wire.BridgeGone(refusal)), text=True)

    async with serve(console, "127.0.0.1", 0) as server:
        address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        pipe = asyncio.subprocess.PIPE
        running = await asyncio.create_subprocess_exec(
            sys.executable, "-c", program, address, "tiago-1", "fleet_x", stdout=pipe, stderr=pipe
        )
        printed, complained = await asyncio.wait_for(running.communicate(), 20)
    assert (printed, complained) == (b"{'x': 1}\n{'x': 2}\n", b"The bridge is not running.\n")
    handshake, look, *acknowledged = heard
    assert handshake == ("/ws/robots/tiago-1/topics/", "Bearer fleet_x")
    assert isinstance(look, wire.Subscribe)
    assert acknowledged == [wire.Ack(), wire.Ack()]
