"""``python -m fleet.site.run_bridge SLUG``: the bridge process of one robot. The fleet supervisor starts it.

It takes its configuration from the environment and gives its records to the records process: without Django, a
bridge needs less memory and starts sooner. When stdin ends, because the fleet supervisor has ended, the bridge stops
the robot and exits.
"""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

from robots.bridge.robot.lean import leave_out, lighten

log = logging.getLogger(__name__)


def main() -> int:
    """Run the bridge; return the exit code."""
    lighten()

    import msgspec

    from fleet.base import logs
    from robots.bridge.robot import sides
    from robots.shared.configuration.bridge_config import BridgeConfig

    # Removed: it has secrets that no child process needs
    config = msgspec.json.decode(os.environ.pop("FLEET_BRIDGE"), type=BridgeConfig)
    if config.link.host is None:
        leave_out("ssl")
    sides.lighten(config.ros)

    from robots.bridge.audit.remote_sink import remote_sink
    from robots.bridge.process import run
    from robots.shared.processes import last_words
    from robots.shared.records.calls import SOCKET
    from robots.shared.sentences import say

    logs.begin(as_json=bool(os.environ.get("FLEET_LOG_JSON")))
    log.info("Fleet console %s: bridge of %s starts.", os.environ.get("FLEET_RELEASE"), config.slug)
    assert config.run_dir is not None  # noqa: S101  (the supervisor's configurations have it)
    sink = remote_sink(str(Path(config.run_dir) / SOCKET), config.robot_id, config.name)
    try:
        return run(config, sink)
    except Exception as error:
        if config.link.unix_path:
            words = say("it failed ({kind}: {error})", kind=type(error).__name__, error=error)
            last_words.write(config.link.unix_path, last_words.LAST, words)
        raise


if __name__ == "__main__":
    sys.exit(main())
