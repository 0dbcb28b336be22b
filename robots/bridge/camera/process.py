"""The camera process: see `robots.bridge.served.process`."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.camera.camera_side import CameraSide
from robots.bridge.camera.picture_server import PictureServer
from robots.bridge.camera.producer import Producer
from robots.bridge.served import process
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.vital import start_vital

NICE = 3
MOST_BYTES = 1024 * 1024 * 1024  # of memory


def run(side: Callable[[str], CameraSide], joined: process.Joined) -> None:
    """Run until stdin ends. `side` gets the frame in which the cameras' poses are wanted."""

    def begin(config: BridgeConfig, call: process.Call) -> Producer:
        server = PictureServer(
            config.link,
            set_wants=lambda wants: producer.set_wants(wants),
            require_key=lambda camera: producer.require_key(camera),
        )
        producer = Producer(
            config,
            server,
            emit=lambda *picture: call(server.show, *picture),
            state=lambda state: call(server.report, state),
            side=side,
        )
        start_vital(producer.run, "producer")
        return producer

    process.run("camera", NICE, MOST_BYTES, begin, joined)
