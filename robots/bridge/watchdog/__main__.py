"""``python -m robots.bridge.watchdog CONFIG``: the watchdog of one robot, until stdin ends. CONFIG is JSON."""

import sys

from robots.bridge.watchdog.lean import leave_out

if __name__ == "__main__":
    leave_out()

    import msgspec

    from robots.bridge.watchdog.process import run
    from robots.shared.configuration.watchdog_config import WatchdogConfig

    sys.exit(run(msgspec.json.decode(sys.argv[1], type=WatchdogConfig)))
