"""Fetch the robot's map in a short-lived process, because the control loop must decode no map.

The map is fetched only while somebody has control: at the start of each control session, and every few
minutes, because a robot may be mapping.
"""

from __future__ import annotations

import asyncio
import logging
from asyncio.subprocess import PIPE
from collections.abc import Callable, Sequence
from contextlib import suppress

import msgspec
from msgspec import Struct

from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.configuration.robot_ros import Ros, side_command
from robots.shared.records.record_sink import TakenMap
from robots.shared.sentences import Sentence, say
from robots.shared.wire.base import Worded

log = logging.getLogger(__name__)

# The process has a lower priority than the control loop from its first line on, like the inspector.
NICE = ("nice", "-n", "10")
END_S = 15.0  # time limit for the process
FRESH_S = 300.0  # age at which a map is fetched again
AGAIN_S = 60.0  # the same after a second failure
WATCHED_S = 10.0  # the same while the robot drives to a place of the map
# the same after the first failure, because nodes of ROS 2 may be found late, and while a restarted robot has no map yet
DOUBTED_S = 2.0
RESTARTS_S = 60.0  # a robot needs less for that
LARGEST_ANSWER = 2 * 1024 * 1024  # bytes


class MapWanted(Struct, frozen=True):
    """The request to the process."""

    ros: Ros
    topic: Topic


class NoMap(Worded, frozen=True, tag=True):
    """There is no usable map; `why` is the reason in words. `is_certain`: a second fetch would find the same."""

    SENTENCES = ("why",)

    why: str
    is_certain: bool = False


_answer = msgspec.msgpack.Decoder(TakenMap | NoMap)


class MapFetcher:
    """Fetches maps; runs on the event loop.

    `keep` receives each fetched map and must not block. `gone` receives the reason why there is no map: if the
    reason is certain, or after the second failure in a row. A restarted robot has time to publish its map, unless it
    drives to a place.
    """

    def __init__(
        self,
        config: BridgeConfig,
        keep: Callable[[TakenMap], None],
        command: Sequence[str] = (),
        gone: Callable[[Sentence], None] = lambda _why: None,
    ) -> None:
        topic = config.topics.map
        self._wanted = MapWanted(config.ros, topic) if topic else None
        self._keep = keep
        self._command = command or (*NICE, *side_command(config.ros, "sensors.map"))
        self._gone = gone
        self._failed = False  # whether the last fetch found no map
        self._watched = False
        self._fence: int | None = None  # control session of the last fetch
        self._run = 0  # of the robot
        self._restarted_s: float | None = None  # when the run began; None: its map has been read
        self._due_s = float("-inf")
        self._taking: asyncio.Task[None] | None = None
        self._logged = ""  # last logged reason why there is no map

    def tick(self, fence: int | None, now_s: float, watched: bool = False, run: int = 0) -> None:
        """Run the periodic work. `fence`: the fence of the session; None: nobody has control.

        `watched`: the robot drives to a place of the map. `run` grows when the robot may have another map: then a
        fetch that has begun is worth nothing.
        """
        if run != self._run:
            self._run, self._restarted_s, self._due_s = run, now_s, now_s
            if self._taking is not None:
                self._taking.cancel()
        if self._wanted is None or fence is None or (self._taking is not None and not self._taking.done()):
            return
        if watched and not self._watched:
            begun_s = self._due_s - FRESH_S  # of the last fetch, if that is long ago
            self._due_s = now_s if now_s - begun_s > WATCHED_S else now_s + WATCHED_S
        self._watched = watched
        if fence != self._fence or now_s >= self._due_s:
            self._fence, self._due_s = fence, now_s + AGAIN_S
            self._taking = asyncio.get_running_loop().create_task(self._take(self._wanted, now_s))

    async def close(self) -> None:
        """End the process, because the bridge ends."""
        if self._taking is not None:
            self._taking.cancel()
            with suppress(asyncio.CancelledError):
                await self._taking

    async def _take(self, wanted: MapWanted, now_s: float) -> None:
        try:
            match await asyncio.wait_for(self._asked(wanted), END_S):
                case TakenMap() as taken:
                    self._due_s = now_s + (WATCHED_S if self._watched else FRESH_S)
                    self._logged, self._failed, self._restarted_s = "", False, None
                    self._keep(taken)
                case NoMap() as none:
                    self._say(none.why)
                    self._fail(none.sentence_of("why"), now_s, none.is_certain)
        except (TimeoutError, OSError, msgspec.MsgspecError) as error:
            self._say(f"the process that fetches it failed ({error!r})")
            self._fail(say("the console could not fetch it"), now_s)

    def _fail(self, why: Sentence, now_s: float, is_certain: bool = False) -> None:
        restarts = self._restarted_s is not None and now_s - self._restarted_s < RESTARTS_S
        if is_certain or (self._failed and (self._watched or not restarts)):
            self._gone(why)
        if restarts or not self._failed:
            self._due_s = now_s + DOUBTED_S
        self._failed = True

    async def _asked(self, wanted: MapWanted) -> TakenMap | NoMap:
        process = await asyncio.create_subprocess_exec(*self._command, stdin=PIPE, stdout=PIPE)
        assert process.stdin is not None and process.stdout is not None  # noqa: S101  (they are pipes)
        try:
            process.stdin.write(msgspec.json.encode(wanted))
            process.stdin.close()
            answer: TakenMap | NoMap = _answer.decode(await _up_to(process.stdout, LARGEST_ANSWER))
            return answer
        finally:
            if not process.stdout.at_eof():  # otherwise the process ends by itself, or has ended
                process.kill()
            await process.wait()

    def _say(self, why: str) -> None:
        if why != self._logged:
            self._logged = why
            log.info("no map of the robot is recorded: %.300r", why)


async def _up_to(stream: asyncio.StreamReader, most: int) -> bytes:
    """Return all output; nothing if it is longer than `most` bytes, which is no valid answer."""
    try:
        await stream.readexactly(most + 1)
    except asyncio.IncompleteReadError as end:
        return end.partial
    return b""
