"""A pose that a person sets for localisation: recorded, then sent when the robot's map is known."""

from __future__ import annotations

from robots.bridge.audit.records import Requester
from robots.bridge.navigation.navigation_goals import NO_NAVIGATION, NavigationGoals, Navigator
from robots.bridge.tasks.at_once import Asked, AtOnce
from robots.bridge.tasks.task import Context, Ending
from robots.shared import wire
from robots.shared.geometry.poses import Pose
from robots.shared.wire import Grant, Refusal


class PoseEstimates(AtOnce):
    """The pose that waits for its record and the map, if any."""

    kinds = (wire.SET_POSE,)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._asked = Asked(wire.SET_POSE, context, self._why_not)
        self._pose: wire.SetPose | None = None

    def take(self, order: wire.SetPose, grant: Grant, requester: Requester, now_s: float) -> None:
        """Record the request, if no rule forbids it, or if the map may come in a moment."""
        navigation = self._navigation
        navigation.controlled(order.fence, now_s)
        refusal = navigation.refuse_map(order.map)
        if refusal is not None and not navigation.may_come(refusal, now_s):
            requester.answer(refusal)
            return
        place = {"x_m": order.x, "y_m": order.y, "heading_rad": order.heading}
        if self._asked.ask(requester, now_s, place):
            self._pose = order

    def drop(self, ending: Ending, now_s: float) -> None:
        self._asked.deny(ending.of_unbegun, now_s)

    def tick(self, now_s: float) -> None:
        """Send the robot the pose that is recorded. It waits for the map, which is read when control begins."""
        pose, navigation = self._pose, self._navigation
        if pose is None:
            return
        refusal = navigation.refuse_map(pose.map)
        if refusal is not None and navigation.may_come(refusal, now_s):
            return
        navigator = self._context.robot.part(Navigator)
        if self._asked.granted(now_s, refusal) and navigator is not None:
            navigator.set_pose(Pose(pose.x, pose.y, pose.heading))
        if not self._asked:
            self._pose = None

    @property
    def _navigation(self) -> NavigationGoals:
        return self._context.tasks.part(NavigationGoals)

    def _why_not(self, now_s: float) -> Refusal | None:
        source = self._context.config.topics.navigation
        if source is None or source.set_pose is None:
            return NO_NAVIGATION
        return self._navigation.busy() or self._context.rules.why_not_still(now_s)
