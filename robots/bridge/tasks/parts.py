"""The list of all parts: one for each kind of task."""

from __future__ import annotations

from robots.bridge.drive.drive_by import DrivesBy
from robots.bridge.head.head_tasks import HeadTasks
from robots.bridge.limbs.limbs import Limbs
from robots.bridge.navigation.navigation_goals import NavigationGoals
from robots.bridge.navigation.pose_estimates import PoseEstimates
from robots.bridge.tasks.at_once import Memory
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.motions import Motions
from robots.bridge.tasks.publishing import Publications
from robots.bridge.tasks.speech import SpeechTasks
from robots.bridge.tasks.task import TaskPart

# In the order in which they are told, and in which their rules are checked.
PARTS: tuple[type[TaskPart], ...] = (
    DrivesBy,
    NavigationGoals,
    Motions,
    Limbs,
    Publications,
    SpeechTasks,
    InputRouting,
    HeadTasks,
    Memory,
    PoseEstimates,
)
