"""Topics that are read as bytes, with what their publishers say of them: for inspector, tap and recorder."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.definitions import UnknownTypeError, definition
from robots.bridge.ros2.message_types import TypeUnknown
from robots.bridge.ros2.network.graph import node_name
from robots.bridge.ros2.network.survey import find_robot
from robots.bridge.ros2.participant import Participant, Subscription, TypeInUse, complain_of_size
from robots.bridge.ros2.qos import as_offered
from robots.bridge.ros2.sizes import MB
from robots.bridge.ros2.versions import other_hash, told_hash
from robots.bridge.tap.arrivals import Kind
from robots.bridge.tap.raw_topic import MOST_PUBLISHERS, Speaker, Take
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import ros2
from robots.shared.sentences import say
from robots.shared.texts import NAME, cut
from robots.shared.wire import Refusal

MOST_BYTES = 32 * MB  # of a message
MOST_WAITING = 16 * MB  # of a topic's messages that wait in DDS, which counts messages and not bytes
MOST_STAYING = 64  # messages of publishers that keep theirs: each has its own
LOOK_S = 0.3  # between two looks for publishers of a topic that has none
AGAIN_S = 2.0  # the same once it has
OFTEN_S = 0.001  # between two messages of a topic: more often is a flood
LEAVE_S = 0.5


class RawTopics:
    """The topics that a process beside the bridge reads in the robot's domain."""

    def __init__(self, config: BridgeConfig, name: str) -> None:
        self._participant = Participant(
            f"{name.strip('/')}_{os.getpid()}",
            ros2(config.ros).domain_id,
        )
        self._lock = threading.Lock()
        self._topics: list[RawTopic] = []
        self._news = threading.Event()
        self._participant.start()
        self.found = find_robot(self._participant, config.topics)  # whether the robot is there
        self._participant.work(self._follow_publishers, "publishers")

    @property
    def participant(self) -> Participant:
        """This process in the domain."""
        return self._participant

    def listen(self, topic: str, take: Take, queue: int) -> RawTopic:
        """Subscribe. `take` gets each message; of what it does not take in time, the newest `queue` are kept."""
        found = RawTopic(self._participant, topic, take, queue, look=self._news.set, closed=self._forget)
        with self._lock:
            self._topics.append(found)
        found.follow()
        return found

    def leave(self) -> None:
        """Leave the domain."""
        self._participant.close(LEAVE_S)

    def _forget(self, topic: RawTopic) -> None:
        with self._lock, suppress(ValueError):
            self._topics.remove(topic)

    def _follow_publishers(self) -> None:
        """Follow publishers that come, go, or change what they offer, without end."""
        while True:
            with self._lock:
                topics = list(self._topics)
            for topic in topics:
                topic.follow_if_due(time.monotonic())
            self._news.wait(LOOK_S)
            self._news.clear()


class RawTopic:
    """One topic. DDS connects equal types only, so the subscription follows the type of the first publisher.

    `look` is called when `follow` should be, `closed` at the end; nodes whose names begin with `ignored` do not count.
    With `spares`, a flood of messages is thinned.
    """

    def __init__(
        self,
        participant: Participant,
        topic: str,
        take: Take,
        queue: int,
        *,
        look: Callable[[], None] = lambda: None,
        closed: Callable[[RawTopic], None] = lambda _: None,
        ignored: str | None = None,
        spares: bool = True,
    ) -> None:
        self._participant = participant
        self._topic = topic
        self._take = take
        self._queue = queue
        self._look, self._closed, self._ignored = look, closed, ignored
        self._spares = spares
        self._lock = threading.RLock()
        self._is_open = True
        self._due_s = 0.0
        self._came_s = float("-inf")
        self._largest = 1  # bytes of a message
        self._asked: tuple[str, QoSProfile] | None = None  # type and profile of the subscription
        self._subscription: Subscription | None = None
        self._speakers: dict[bytes, Speaker] = {}

    def close(self) -> None:
        """Unsubscribe."""
        with self._lock:
            self._is_open = False
            self._unsubscribe()
        self._closed(self)

    def speakers(self) -> list[Speaker]:
        """Return the present publishers."""
        self.follow()
        return list(self._speakers.values())

    def follow_if_due(self, now_s: float) -> None:
        """Look at the publishers, if the last look was long ago."""
        if now_s >= self._due_s:
            self._due_s = now_s + (AGAIN_S if self._speakers else LOOK_S)
            self.follow()

    def follow(self) -> None:
        """Look at the publishers; subscribe with the type of the first, and as much as all of them offer."""
        found = self._participant.node.get_publishers_info_by_topic(self._topic)[:MOST_PUBLISHERS]
        if self._ignored is not None:
            found = [one for one in found if not node_name(one).startswith(self._ignored)]
        with self._lock:
            if not self._is_open:
                return
            self._speakers = {bytes(one.endpoint_gid): self._speaker(one) for one in found}
            types = list(dict.fromkeys(one.topic_type for one in found))
            if types and (self._asked is None or self._asked[0] not in types):
                self._subscribe(types[0], found)
            elif self._asked is not None and types:
                self._subscribe(self._asked[0], found)

    def _speaker(self, publisher: TopicEndpointInfo) -> Speaker:
        speaker = _described(publisher)
        before = self._speakers.get(bytes(publisher.endpoint_gid))
        return before if before == speaker else speaker

    def _subscribe(self, type_name: str, publishers: list[TopicEndpointInfo]) -> None:
        qos = as_offered(one.qos_profile for one in publishers if one.topic_type == type_name)
        stays = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        qos.depth = self._depth(max(self._queue, MOST_STAYING) if stays else self._queue)
        if (type_name, qos) == self._asked:
            return
        self._unsubscribe()
        self._asked = type_name, qos
        try:
            self._subscription = self._participant.listen(
                self._topic,
                type_name,
                partial(self._receive, type_name),
                qos,
                largest=sys.maxsize,
                any_version=True,
            )
        except TypeUnknown:
            pass  # its speakers say it
        except TypeInUse:
            self._asked, self._due_s = None, 0.0

    def _depth(self, most: int) -> int:
        """Return how many messages may wait: a power of two below `most`, so that it seldom changes."""
        fitting = MOST_WAITING // self._largest
        return most if fitting >= most else 1 << max(fitting.bit_length() - 1, 0)

    def _unsubscribe(self) -> None:
        if self._subscription is not None:
            self._subscription.unregister()
            self._subscription = None

    def _receive(self, type_name: str, data: bytes, info: Any) -> None:
        now_s = time.monotonic()
        if len(data) > self._largest:  # then fewer may wait
            self._largest, self._due_s = len(data), 0.0
            self._look()
        if len(data) > MOST_BYTES:
            complain_of_size(self._topic, len(data), MOST_BYTES)
            return
        self._take(self._speaker_of(info.get("publisher_gid"), type_name), data)
        # DDS keeps the newest meanwhile: a flood costs as much as 1,000 messages a second
        if self._spares and now_s - self._came_s < OFTEN_S:
            time.sleep(OFTEN_S)
        self._came_s = time.monotonic()

    def _speaker_of(self, gid: Any, type_name: str) -> Speaker:
        """Return who sent a message. Humble does not say it: then it is the first publisher of this type."""
        speakers = self._speakers
        if gid is not None and (found := speakers.get(_key(gid))) is not None:
            return found
        if gid is not None:
            self.follow()
            if (found := self._speakers.get(_key(gid))) is not None:
                return found
        of_type = [one for one in speakers.values() if one.kind.type == type_name]
        return of_type[0] if of_type else Speaker("", Kind(type_name, ""), False, "", None, None)


def _key(gid: Any) -> bytes:
    return bytes(gid["data"] if isinstance(gid, dict) else gid)


def _described(publisher: TopicEndpointInfo) -> Speaker:
    type_name = cut(publisher.topic_type, NAME)
    kind = Kind(type_name, told_hash(publisher))
    latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    node = node_name(publisher)
    try:
        found = definition(type_name)
    except UnknownTypeError as error:
        refusal = Refusal("type_unknown", str(error), "robot", {"type": type_name})
        return Speaker(node, kind, latched, "", None, refusal)
    if other_hash(publisher, found.md5):
        text = say("{type} has other fields on the robot than in the package installed here.", type=type_name)
        return Speaker(
            node, kind, latched, "", None, Refusal("type_differs", text, "robot", {"type": type_name})
        )
    return Speaker(node, kind, latched, found.text, found, None)
