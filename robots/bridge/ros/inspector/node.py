"""The inspector's rospy node: started by the first subscription or publication."""

from __future__ import annotations

from collections.abc import Callable

from robots.bridge.ros import child_node
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.inspector.publishing import Publishers
from robots.bridge.ros.inspector.subscriptions import Subscriptions
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.graph import INSPECTOR
from robots.shared.ros.master import Master


class Node:
    """Subscribes and publishes at one robot. The process ends when the master dies."""

    def __init__(
        self,
        config: BridgeConfig,
        master: Master,
        definitions: Definitions,
        send: Callable[[str, bytes], None],
    ) -> None:
        child_node.join(config, INSPECTOR)
        self.subscriptions = Subscriptions(definitions, send)
        self.publishers = Publishers(master)

    def close(self) -> None:
        """Unregister from the master."""
        child_node.leave()
