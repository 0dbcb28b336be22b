"""The process that fetches the robot's map once: what its publishers agree on. Reads JSON, writes MessagePack.

A separate process, because a map has up to 16 MB and the control loop must not decode it; it ends within `END_S`.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Mapping

import msgspec
from msgspec import Struct

from robots.bridge.maps.map_fetch import END_S, MapWanted, NoMap
from robots.shared.processes.memory import limit_memory
from robots.shared.processes.shutdown import exit_within
from robots.shared.records.record_sink import TakenMap
from robots.shared.sentences import joined, say

MOST_BYTES = 1024 * 1024 * 1024  # of memory


class Without(Struct, frozen=True):
    """A publisher from which navigation has no map either: it has ended, or has published none. `why` in words."""

    why: str


def agreed(answers: Mapping[str, TakenMap | NoMap | Without], topic: str) -> TakenMap | NoMap:
    """Return the one map of these nodes. A node whose answer is unknown may publish another one."""
    maps = {node: answer for node, answer in answers.items() if isinstance(answer, TakenMap)}
    if len({taken_map.digest for taken_map in maps.values()}) > 1:
        nodes = ", ".join(maps)
        why = say("the nodes {nodes} publish different maps on {topic}", nodes=nodes, topic=topic)
        return NoMap(why, is_certain=True)
    unknown = {node: answer.why for node, answer in answers.items() if isinstance(answer, NoMap)}
    if maps and not unknown:
        return next(iter(maps.values()))
    without = {node: answer.why for node, answer in answers.items() if isinstance(answer, Without)}
    whys = [say("{node}: {why}", node=node, why=why) for node, why in (unknown or without).items()]
    return NoMap(joined("; ", whys) if whys else say("nobody publishes {topic}", topic=topic))


def run(read_map: Callable[[MapWanted], TakenMap | NoMap]) -> None:
    """Answer one request from stdin on stdout."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the bridge handles it and ends this process
    exit_within(END_S)
    limit_memory(MOST_BYTES)
    wanted = msgspec.json.decode(sys.stdin.buffer.read(), type=MapWanted)
    sys.stdout.buffer.write(msgspec.msgpack.encode(read_map(wanted)))
