"""Stand-ins for bridges of robots at rest, all in one process: `python -m benchmarks.growth.bridges_side LINKS`.

LINKS is a JSON object: from the path of a link to the key of its robot. Each reports a state twice a second, as a
bridge does: ages and odometry differ each time, what pages show does not. It grants control, and prints the number of
each drive message with its time of arrival (monotonic ns).
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
import time

import msgspec

from robots.bridge.server.link_server import Link, LinkServer
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress

REPORT_S = 0.5
_SENSORS = ("/scan", "/base_scan")
_STATE = wire.State(
    phase="online",
    text="The robot is ready.",
    stop=wire.StopState("clear"),
    verdict=wire.Verdict("idle", "", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    odometry=None,
    sensors=[],
    battery_percent=80.0,
    charging=False,
    holder=None,
    fence=None,
    seq=None,
    neutral_needed=None,
    foreign=[],
    watchers=[],
    clock_skew_s=0.001,
    refused={},
    stands=True,
    health=wire.Health("ok", [], 0, 12, [wire.Temperature("Motors: left wheel", 41)]),
)


def at_rest() -> wire.State:
    """Return the state of a robot at rest."""
    noise = random.random()  # noqa: S311
    return msgspec.structs.replace(
        _STATE,
        odometry=wire.Odometry(1.0 + 1e-4 * noise, 2.0, 0.5, 1e-4 * noise, 0.0, -1e-4 * noise),
        unseen_s=0.02 * noise,
        battery_percent=80.0 + 0.4 * noise,
        sensors=[wire.Sensor(name, "scan", True, 0.1 * noise) for name in _SENSORS],
        location=wire.Location(1.0, 2.0, 0.5, 0.1 * noise, 0.1, 0.0, 0.01, noise),
    )


class StandIn:
    """One bridge."""

    def __init__(self, path: str, robot: str) -> None:
        self._robot = robot
        self._server = LinkServer(
            LinkAddress(unix_path=path), self._open, self._take, lambda _link: None, self._quick
        )

    async def run(self) -> None:
        await self._server.start()
        await asyncio.sleep(REPORT_S * random.random())  # noqa: S311 - bridges do not report in step
        while True:
            status = wire.Status(at_rest())
            for link in self._server.links:
                link.report(status)
            await asyncio.sleep(REPORT_S)

    def _open(self, link: Link) -> None:
        link.report(wire.BridgeHello(wire.PROTOCOL, self._robot, "growth", 0))

    async def _take(self, link: Link, raw: bytes) -> None:
        match wire.link_request(raw):
            case wire.LinkHello() | wire.LinkState():
                link.report(wire.Status(at_rest()))
            case wire.Grant(fence=fence):
                link.report(wire.Granted(fence))
            case wire.Drive(seq=seq):
                print(seq, time.monotonic_ns())

    def _quick(self, _link: Link, raw: bytes) -> None:
        now_ns = time.monotonic_ns()
        match wire.link_request(raw):
            case wire.Drive(seq=seq):
                print(seq, now_ns)


async def main() -> None:
    """Run until killed."""
    links = json.loads(sys.argv[1])
    await asyncio.gather(*(StandIn(path, robot).run() for path, robot in links.items()))


if __name__ == "__main__":
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    asyncio.run(main())
