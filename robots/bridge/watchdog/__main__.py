"""``python -m robots.bridge.watchdog CONFIG``: the watchdog of one robot, until stdin ends. CONFIG is JSON."""

import sys

from robots.bridge.robot.lean import leave_out, lighten

if __name__ == "__main__":
    lighten()
    leave_out("ssl")

    import msgspec

    from robots.bridge.robot import sides
    from robots.shared.configuration.watchdog_config import WatchdogConfig

    config = msgspec.json.decode(sys.argv[1], type=WatchdogConfig)
    sides.lighten_watchdog(config.ros)

    from robots.bridge.watchdog.process import run

    sys.exit(run(config))
