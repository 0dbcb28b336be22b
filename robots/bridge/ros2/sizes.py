"""The largest message of each type that is read: far above the data of real robots."""

from __future__ import annotations

from robots.shared.configuration.gate_profile import MOST_BEAMS
from robots.shared.texts import DESCRIPTION

KB, MB = 1024, 1024 * 1024
BRIEF = 4 * KB  # header, names and a few numbers

MOST_BYTES = {
    "LaserScan": BRIEF + 2 * 4 * MOST_BEAMS,  # ranges and intensities
    "CompressedImage": 16 * MB,
    "Image": 16 * MB,
    "OccupancyGrid": 16 * MB + BRIEF,  # robots.shared.maps.occupancy.MOST_CELLS
    "PointCloud2": 32 * MB,
    "Path": 1 * MB,  # 5,000 poses are 0.4 MB
    "CameraInfo": 16 * KB,
    "DiagnosticArray": 256 * KB,
    "TFMessage": 256 * KB,
    "String": BRIEF + 4 * DESCRIPTION,  # a robot's description
}


def most_bytes(type_name: str) -> int:
    """Return the size of the largest message of this type that is read."""
    return MOST_BYTES.get(type_name.rpartition("/")[2], 64 * KB)
