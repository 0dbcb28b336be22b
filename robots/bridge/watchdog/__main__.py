"""``python -m robots.bridge.watchdog CONFIG``: the watchdog of one robot, until stdin ends. CONFIG is JSON."""

import sys

import msgspec

from robots.bridge.watchdog.process import run
from robots.shared.configuration.watchdog_config import WatchdogConfig

if __name__ == "__main__":
    sys.exit(run(msgspec.json.decode(sys.argv[1], type=WatchdogConfig)))
