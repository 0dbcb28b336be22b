"""Results that only robots with ROS 2 have: what else is in the domain, and how its messages travel."""

from __future__ import annotations

from collections.abc import Iterator

from django.utils.translation import gettext as _

from robots.check.results import FAIL, WARN, Check, listed
from robots.shared.processes.probe_findings import Findings


def domain_checks(findings: Findings) -> Iterator[Check]:
    """Yield the faults of a robot's domain."""
    yield from _twins(findings)


def namespace_check(odometry: str, namespaces: list[str]) -> Check:
    """Return that the robot's names begin otherwise than the registry says: then none of them is found."""
    text = _("No node publishes %(topic)s, but there is such a topic in the namespace %(found)s.")
    words = {"topic": odometry, "found": listed([one or "/" for one in namespaces])}
    advice = _("Is that this robot? Then enter its namespace; if it is /, none. It may be another robot.")
    return Check(_("namespace"), FAIL, text % words, advice)


def _twins(findings: Findings) -> Iterator[Check]:
    """Yield a fault if two robots seem to have the same names: DDS lets both live, and a twist moves both."""
    advice = _("Give each robot a domain or a namespace of its own.")
    odometry = findings.topics[0].publishers
    if len(odometry) > 1:
        text = _("%s publish odometry: two robots seem to be in this domain.") % listed(odometry)
        yield Check(_("two robots"), FAIL, text, advice)
    elif findings.twins:
        text = _("Several nodes are called %s: do two robots, or two starts of one robot, share this domain?")
        yield Check(_("two robots"), WARN, text % listed(findings.twins), advice)
