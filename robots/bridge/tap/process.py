"""The tap's process: see `robots.bridge.served.process`."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.served import process
from robots.bridge.tap.source import Listen, Source
from robots.bridge.tap.tap_server import TapServer
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.processes.vital import start_vital

NICE = 3
MOST_BYTES = 1536 * 1024 * 1024  # of memory


def run(listening: Callable[[BridgeConfig], Listen], joined: process.Joined) -> None:
    """Run until stdin ends."""

    def begin(config: BridgeConfig, call: process.Call) -> Source:
        server = TapServer(
            config.link,
            set_wanted=lambda wanted: source.set_wanted(wanted),
            wake=lambda: call(server.take_arrivals),
        )
        source = Source(server, call, listening(config))
        start_vital(source.run, "source")
        return source

    process.run("tap", NICE, MOST_BYTES, begin, joined)
