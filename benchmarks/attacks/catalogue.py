"""All attacks, in the order in which they are run."""

from __future__ import annotations

from typing import Literal, NamedTuple

from benchmarks.attacks.figures import ENDED_ZERO_S, TIMES, ZERO_S, Limits

QUICK = 50  # of up to 100 presses, the p99 is the worst press: the long form has 120, so its p99 is another
Side = Literal["ros", "web", "stop", "incident"]


class Attack(NamedTuple):
    """An attack; the module of its `side` has a role of the same name."""

    name: str
    side: Side
    words: str
    limits: Limits = Limits()
    as_who: str = ""  # demo account whose session the attackers use, if any
    plays: bool = False  # the driver requests a motion in each slot

    @property
    def quick(self) -> int:
        """Return the number of quick presses in each slot."""
        return QUICK if self.limits.times else 0

    @property
    def section(self) -> int:
        """Return the section: 1: from a robot's network, and incidents at a bridge; 2: at the web port."""
        return 2 if self.side in ("web", "stop") else 1


_ENDED = Limits(zero_s=ENDED_ZERO_S)
_BESIDE = Limits(times=TIMES)
_STOPS = Limits(answer_s=ZERO_S)

ATTACKS = (
    Attack("long-name", "ros", "a node with a name of 9 MB on the drive topic"),
    Attack("long-type", "ros", "a type of 9 MB for the drive topic"),
    Attack("long-result", "ros", "a motion's result of 9 MB", plays=True),
    Attack("huge-scans", "ros", "a laser of 3 million beams at 10 Hz"),
    Attack("fast-scans", "ros", "a laser of 20,000 beams as fast as the bridge reads"),
    Attack("large-pictures", "ros", "a depth camera of 12 million pixels at 3 Hz"),
    Attack("declared-scan", "ros", "a laser whose message declares 4 GB"),
    Attack("declared-header", "ros", "connections to the bridge that declare a header of 4 GB"),
    Attack("declared-call", "ros", "calls to the bridge that declare 4 GB"),
    Attack("frames", "ros", "/tf with 10,000 new frames a second"),
    Attack("small-messages", "ros", "odometry and sonar at 2 kHz each"),
    Attack("many-topics", "ros", "1500 nodes and topics with long names"),
    Attack("shutdown-call", "incident", "a stranger's shutdown call", _ENDED),
    Attack("same-name", "incident", "a node with the bridge's name", _ENDED),
    Attack("frozen", "incident", "the bridge frozen for 3 s"),
    Attack("killed", "incident", "the bridge killed", _ENDED),
    Attack("guesses", "web", "60 guesses of a password at once, again and again", _BESIDE),
    Attack("bodies", "web", "POSTs of 500 MB to any address", _BESIDE),
    Attack("slow-heads", "web", "200 connections with endless headers", _BESIDE),
    Attack("idle", "web", "300 silent connections", _BESIDE),
    Attack("huge-frames", "web", "WebSocket frames of 500 MB", _BESIDE),
    Attack("handshakes", "web", "WebSocket handshakes of 4 MB", _BESIDE),
    Attack("pages", "web", "100 pages and REST answers a second", _BESIDE, as_who="observer"),
    Attack("refused", "web", "an observer's refused messages", _BESIDE, as_who="observer"),
    Attack("stranger", "stop", "400 connections, stops of one who sees no robot", _STOPS),
    Attack("strangers", "stop", "the same of ten such people, from 40 addresses", _STOPS),
    Attack("stranger-tokens", "stop", "the same with tokens", _STOPS),
    Attack("invented-sessions", "stop", "400 connections, stops with invented sessions", _STOPS),
    Attack("invented-tokens", "stop", "the same with invented tokens, from one address", _STOPS),
    Attack("colleague", "stop", "400 connections, stops of one who may stop", _STOPS),
    Attack("colleagues", "stop", "the same of ten such people, from 40 addresses", _STOPS),
    Attack("colleague-tokens", "stop", "the same with tokens", _STOPS),
    Attack("open-requests", "stop", "two addresses with 220 open requests each", _STOPS),
    Attack("invented-sockets", "stop", "200 WebSocket handshakes at once, invented sessions", _STOPS),
)
