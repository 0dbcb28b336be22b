"""``python -m robots.bridge.watchdog CONFIG``: the watchdog of one robot, until stdin ends. CONFIG is JSON."""

import sys

from robots.bridge.ros.lean import leave_out, lighten

if __name__ == "__main__":
    lighten()
    leave_out("numpy", "ssl")

    import msgspec

    from robots.bridge.watchdog.process import run
    from robots.shared.configuration.watchdog_config import WatchdogConfig

    sys.exit(run(msgspec.json.decode(sys.argv[1], type=WatchdogConfig)))
