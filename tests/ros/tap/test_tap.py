"""A tap with a real rosmaster: messages of any type, whole, in each form; bad publishers; the end."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
import rospy
from msgspec.structs import replace
from sensor_msgs.msg import Image
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from robots.link import connections
from robots.link.client import BridgeLink
from robots.shared.configuration.bridge_config import LinkAddress
from script.stack.certificates import certificate_for
from teleop.tap.feed import TapFeed, TapMessage, TapReader
from tests.processes import PATIENCE_S, free_port
from tests.ros.bridge_support import running_bridge, tiago_config


@pytest.fixture
def latch() -> Iterator[Any]:
    """``latch(topic, message)`` publishes one message for all who come later."""
    publishers = []

    def publish(topic: str, message: Any, latched: bool = True) -> rospy.Publisher:
        publisher = rospy.Publisher(f"/{topic}", type(message), queue_size=10, latch=latched)
        publishers.append(publisher)
        publisher.publish(message)
        return publisher

    yield publish
    for publisher in publishers:
        publisher.unregister()


@contextmanager
def bridge_host(rosmaster: Any, folder: Path) -> Iterator[tuple[UUID, LinkAddress]]:
    """A bridge that listens on the network, too; yields the address that a web process elsewhere has."""
    made = certificate_for(["127.0.0.1"], folder / "tls")
    address = LinkAddress(
        host="127.0.0.1",
        port=free_port(),
        certificate=str(made.certificate),
        private_key=str(made.private_key),
        secret="s3cret",
        authority=str(made.authority),
    )
    config = tiago_config(rosmaster, folder)
    config = replace(config, link=replace(address, unix_path=config.link.unix_path))
    with running_bridge(config, rosmaster, folder):
        yield UUID(config.robot_id), address


async def test_a_web_process_elsewhere_reads_over_tls_with_the_secret(
    rosmaster, ros, latch, tmp_path, monkeypatch
):
    """The bridge starts the tap and tells its port; host, secret and authority are those of the link."""

    async def not_here(path: str, **_: Any) -> None:
        raise FileNotFoundError(path)

    monkeypatch.setattr(connections, "unix_connect", not_here)
    picture = Image(height=1000, width=1000, encoding="mono8", data=bytes(range(250)) * 4000)
    latch("far", picture)
    with bridge_host(rosmaster, tmp_path) as (robot, address):
        link, arrived = BridgeLink(robot, address), asyncio.Queue()

        async def deliver(topic: str, form: str, message: TapMessage) -> None:
            arrived.put_nowait((topic, form, message))

        reader = TapReader(TapFeed(link), deliver, lambda _: None, lambda: False)
        assert reader.read("/far", "raw") is None
        topic, form, message = await asyncio.wait_for(arrived.get(), PATIENCE_S)
        assert (topic, form, Image().deserialize(message.body).data) == ("/far", "raw", picture.data)
        trusting = ssl.create_default_context(cafile=address.authority)
        with pytest.raises(InvalidStatus, match="401"):
            await connect(f"wss://127.0.0.1:{reader.feed._tap._at.port}/", ssl=trusting)
        reader.leave()
        await link.close()
