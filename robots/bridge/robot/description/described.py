"""Findings of the robot check in the robot's description."""

from __future__ import annotations

from robots.bridge.arm.tree import Tree
from robots.shared.configuration.bridge_config import ArmSource
from robots.shared.processes.probe_findings import DescriptionFound
from robots.shared.sentences import reason_of, say
from robots.shared.urdf.document import BadDescription


def described(arm: ArmSource | None, description: object) -> DescriptionFound:
    """Return what is in the description, and what it lacks of the arm."""
    if not isinstance(description, str):
        return DescriptionFound(error=say("there is none"))
    try:
        tree = Tree(description)
    except BadDescription as error:
        return DescriptionFound(error=reason_of(error))
    if arm is None:
        return DescriptionFound(text=description)
    return DescriptionFound(
        links=[link for link in arm.links if link not in tree],
        joints=[joint for joint in arm.home if not tree.moved_by([joint])],
        unplaced=sorted(tree.unplaced.intersection(arm.links)),
        text=description,
    )
