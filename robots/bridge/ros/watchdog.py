"""The watchdog's rospy node. It only publishes, so that no message of the robot can delay it."""

from __future__ import annotations

import logging
import os
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import rospy
from actionlib_msgs.msg import GoalID
from geometry_msgs.msg import Twist, TwistStamped
from rospy.impl.registration import get_service_manager, get_topic_manager

from robots.bridge.ros.bounds.install import install
from robots.bridge.ros.shutdown import refuse_shutdown
from robots.bridge.ros.tasks.publishing import heard_by, immediate_publisher, publish, stamped
from robots.shared.configuration.robot_ros import ros1
from robots.shared.configuration.watchdog_config import WatchdogConfig
from robots.shared.ros.master import DeathWatch, Master, MasterError, node_alive
from robots.shared.ros.registration import register_again

if TYPE_CHECKING:
    from collections.abc import Callable

    from robots.bridge.robot.interface import StopSide

log = logging.getLogger(__name__)

RETRY_S = 0.5
CHECK_S = 0.5  # between checks of the registration and of the drive topics
SEND_PATIENCE_S = 0.02  # if a listener's buffer is full for longer, the listener does not read
FLUSH_S = 0.1
THEFT_S = 10.0  # a name that is taken twice within this time belongs to a node that registers again, too


class WatchdogNode:
    """Publishes zeros and cancels at one robot, also without its master."""

    def __init__(self, config: WatchdogConfig) -> None:
        self._config = config
        self._master = Master(ros1(config.ros).master_uri, config.node)
        self._stamped = config.drive.type == "geometry_msgs/TwistStamped"
        self._wanted = {config.drive.name}
        self._drives: dict[str, rospy.Publisher] = {}
        self._cancels: list[rospy.Publisher] = []
        self._joined = False
        self._taken_s = float("-inf")  # when another node took the name
        self._ending = threading.Event()

    def start(self) -> None:
        """Search for the master on a separate thread."""
        os.environ["ROS_MASTER_URI"] = self._master.uri
        os.environ.setdefault("ROS_LOG_DIR", str(Path(self._config.state_dir) / "ros-log"))
        threading.Thread(target=self._keep_registered, name="master", daemon=True).start()

    def stop(self) -> None:
        """Unregister from the master, if it answers."""
        self._ending.set()
        if self._joined:
            time.sleep(FLUSH_S)  # the last bytes leave before the socket is closed
            leaving = threading.Thread(target=rospy.signal_shutdown, args=("watchdog ends",), daemon=True)
            leaving.start()
            leaving.join(1.0)

    # --- called by the watchdog (watchdog.process.Watchdog) --------------------------------------------

    def zero(self) -> int:
        """Publish a zero velocity on every drive topic; returns the number of nodes that it was written to."""
        twist = Twist()
        messages = [stamped(twist, agree) for agree in (True, False)] if self._stamped else [twist]
        reached = 0
        for publisher in list(self._drives.values()):
            try:
                for message in messages:  # one of them is taken by any clock
                    publish(publisher, message)
            except rospy.ROSException as error:  # its topic is being closed
                log.warning("a zero was not published: %s", error)
            reached += len(heard_by(publisher))
        return reached

    def cancel(self) -> None:
        """Cancel the goals of all clients: an empty goal id means all."""
        for publisher in self._cancels:
            publish(publisher, GoalID())

    def drive_to(self, topic: str) -> None:
        """Publish zeros on this topic from now on, in addition to the default topic. Returns at once."""
        self._wanted = {self._config.drive.name, topic}

    # --- on the thread for the master ------------------------------------------------------------------

    def _keep_registered(self) -> None:
        while not self._ending.is_set():
            try:
                self._master.alive()
                with closing(DeathWatch(self._master.uri)) as watch:
                    self._join()
                    self._stay(watch)
            except MasterError as error:
                log.debug("%s", error)  # the bridge reports it on the page
            except Exception:
                log.exception("watching the robot's master failed")
            self._ending.wait(RETRY_S)

    def _join(self) -> None:
        """Register with the master. If that fails, end the process: rospy starts only once in a process."""
        if self._joined:
            return
        try:
            install(lambda: os._exit(1))
            refuse_shutdown()
            rospy.init_node(
                self._config.node.strip("/"),
                argv=[],
                anonymous=self._has_namesake(),
                disable_signals=True,
                disable_rostime=True,
                disable_rosout=True,
            )
            self._cancels = [
                immediate_publisher(f"{action}/cancel", GoalID, SEND_PATIENCE_S)
                for action in self._config.actions
            ]
            self._attend()
        except Exception:
            log.exception("joining the robot's master failed")
            os._exit(1)
        self._joined = True
        log.info("joined the robot's master as %s", rospy.get_name())

    def _has_namesake(self) -> bool:
        """Return whether another watchdog with this name lives, of a console with a copy of this database.

        Then this one joins under a name of its own: both can stop the robot, and neither ends the other.
        """
        uri = self._master.node_uri(self._config.node)
        if uri is None or node_alive(uri, self._config.node) is False:
            return False
        log.error("the watchdog at %s has this name: if another console runs there, end one of the two", uri)
        return True

    def _stay(self, watch: DeathWatch) -> None:
        """Run until the master is gone. Register again if another node takes or removes this node's name."""
        while not self._ending.is_set():
            if self._master.node_uri(rospy.get_name()) != rospy.get_node_uri():
                log.warning("the robot's master does not know this watchdog any more: registering again")
                self._yield_to_namesake()
                register_again(self._master, rospy.get_node_uri(), get_topic_manager(), get_service_manager())
            self._attend()
            if watch.wait(CHECK_S):
                return

    def _yield_to_namesake(self) -> None:
        """End the process if the name was taken twice in a short time: the next one joins under another name."""
        now_s, before_s = time.monotonic(), self._taken_s
        uri = self._master.node_uri(rospy.get_name())
        if uri is None or not node_alive(uri, rospy.get_name()):
            return  # the master started again, or a node took the name and ended
        self._taken_s = now_s
        if now_s - before_s < THEFT_S:
            log.error("another watchdog, at %s, takes this one's name again and again: starting again", uri)
            os._exit(1)

    def _attend(self) -> None:
        """Keep a publisher for each wanted drive topic, and for no other."""
        kind = TwistStamped if self._stamped else Twist
        wanted = self._wanted
        for name in wanted - self._drives.keys():
            self._drives = {**self._drives, name: immediate_publisher(name, kind, SEND_PATIENCE_S)}
        for name in self._drives.keys() - wanted:
            left = self._drives[name]
            self._drives = {topic: one for topic, one in self._drives.items() if one is not left}
            left.unregister()


if TYPE_CHECKING:
    SIDE: Callable[[WatchdogConfig], StopSide] = WatchdogNode
