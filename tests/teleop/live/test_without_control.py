"""Commands without control: the table of docs/protocol.md, and what the console answers."""

import re
from pathlib import Path
from typing import get_args

import pytest

from fleet.audit.models import Record
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.wire.decoders import BrowserMessage
from robots.shared.wire.topics import TopicQuery
from teleop.background.database import in_database
from tests.bridge import support
from tests.teleop.live.test_task_sender import FENCE, ORDERS
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)

PROTOCOL = Path(__file__).parents[3] / "docs/protocol.md"
ALLOWED = (
    Allowed("call", "/clear_costmaps", "std_srvs/Empty", "", "operator"),
    Allowed("set", "/volume", "", "", "operator"),
    Allowed("publish", "/notes", "std_msgs/String", "", "operator"),
)
TASKS = {one.__struct_config__.tag for one in get_args(wire.TaskRequest)}
FIELDS = (
    {wire.kind_of(order): wire.to_builtins(order) for order in support.ORDERS.values()}
    | ORDERS
    | {
        "publish": {"topic": "/notes", "type": "std_msgs/String", "fields": {}, "sent_ms": 1.0},
        "drive": {"sent_ms": 1.0, "x": 0.5, "w": 0.0, "y": 0.0, "share": 0.5},
        "hand_over": {"number": 1},
    }
)
CALLS = {
    "call": {"service": "/clear_costmaps", "fields": {}},
    "set_parameter": {"name": "/volume", "value": 50},
}


def table():
    """Return the commands of each row of the table, by the row's first words."""
    section = PROTOCOL.read_text().split("## Commands and control")[1].split("## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("| ")][1:]
    cells = [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines]
    found = {who: set(re.findall(r"`([a-z_]+)`", commands)) - {"fence"} for who, commands in cells}
    [by_fence] = (commands for who, commands in found.items() if "`fence`" in who)
    by_fence |= TASKS.difference(*found.values())
    return found


def by_fence():
    return sorted(next(commands for who, commands in table().items() if "`fence`" in who))


def test_the_table_has_every_command_once():
    kinds = [one.__struct_config__.tag for one in (*get_args(BrowserMessage), *get_args(TopicQuery))]
    listed = [command for commands in table().values() for command in commands]
    assert sorted(listed) == sorted({*kinds, "subscribe", "unsubscribe"})
    assert set(CALLS) in table().values()


async def test_staff_without_control_command_nothing(open_page, bridge):
    page = await open_page("staff")
    for kind in sorted(set(by_fence()) - {"release", "camera_view"}):  # these two end, or report, nothing
        fence = {"fence": FENCE, "seq": 1} if kind not in ("renew", "hand_over") else {}
        await page.say(**{"t": kind} | FIELDS.get(kind, {}) | fence)
        refused = await page.hears("refused", of=kind)
        assert refused["refusal"]["rule"] == "lease", refused
    assert not any(bridge.all(command) for command in get_args(wire.TaskRequest))


@pytest.mark.parametrize("kind", CALLS)
@pytest.mark.parametrize("another", [False, True], ids=["free", "held by another"])
async def test_staff_call_services_only_with_control(
    kind, another, robot, browsers, websocket_headers, open_page, bridge, allow
):
    allow(*ALLOWED)
    if another:
        await (await open_page("operator")).take()
    page = await open_page("staff")
    topics = await Page(websocket_headers(browsers["staff"]), f"/ws/robots/{robot.slug}/topics/").open()
    await topics.say(kind, seq=1, **CALLS[kind])
    assert (await topics.hears("refused", of=kind, seq=1))["refusal"]["code"] == "no_lease"
    assert not bridge.all(wire.LinkQuery)
    assert not await in_database(Record.objects.filter(kind__in=["service.call", "parameter.set"]).exists)
    if not another:
        await page.take()
        await topics.say(kind, seq=2, **CALLS[kind])
        await bridge.hears(wire.LinkQuery)
    await topics.close()
