"""``python -m robots.bridge.ros.camera``: see `robots.bridge.served.process`."""

from __future__ import annotations

from functools import partial

from robots.bridge.camera.picture_server import PictureServer
from robots.bridge.ros.camera.producer import Producer
from robots.bridge.ros.child_node import joined
from robots.bridge.served.process import Call, run
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import CAMERA
from robots.shared.processes.vital import start_vital

NICE = 3
MOST_BYTES = 1024 * 1024 * 1024  # of memory


def begin(config: BridgeConfig, call: Call) -> Producer:
    """Start the producer; its server is not started yet."""
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
    )
    start_vital(producer.run, "producer")
    return producer


if __name__ == "__main__":
    run("camera", NICE, MOST_BYTES, begin, partial(joined, CAMERA))
