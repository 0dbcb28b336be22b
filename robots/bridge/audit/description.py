"""The robot's description (URDF) in the form in which the bridge passes it to the console's database."""

from __future__ import annotations

import hashlib
import zlib

from robots.shared.records.record_sink import TakenDescription
from robots.shared.sentences import catalogued
from robots.shared.urdf.document import LARGEST


def taken_description(found: object) -> TakenDescription:
    """Return the parameter `robot_description` for storage; only a `problem` if it is not usable."""
    if not isinstance(found, str):
        return _problem(catalogued("the parameter /robot_description of the robot is not a text"))
    if len(found) >= LARGEST:  # a longer text was cut when it was read
        return _problem(catalogued("the robot’s description is too large"))
    text = found.encode(errors="replace")
    return TakenDescription(hashlib.sha256(text).hexdigest(), zlib.compress(text))


def _problem(words: str) -> TakenDescription:
    return TakenDescription("", b"", words)
