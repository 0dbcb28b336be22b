"""``python -m robots.bridge.ros.tap``: see `robots.bridge.served.process`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from robots.bridge.ros.child_node import joined
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.tap.source import Source
from robots.bridge.served.process import Call, run
from robots.bridge.tap.tap_server import TapServer
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import TAP
from robots.shared.processes.vital import start_vital

NICE = 3
MOST_BYTES = 1536 * 1024 * 1024  # of memory


def begin(config: BridgeConfig, call: Call) -> Source:
    """Start the source; its server is not started yet."""
    server = TapServer(
        config.link,
        set_wanted=lambda wanted: source.set_wanted(wanted),
        wake=lambda: call(server.take_arrivals),
    )
    source = Source(server, call, Definitions(Path(config.state_dir) / "definitions"))
    start_vital(source.run, "source")
    return source


if __name__ == "__main__":
    run("tap", NICE, MOST_BYTES, begin, partial(joined, TAP))
