"""The first stop by HTTP does not wait for imports."""

from __future__ import annotations

import subprocess
import sys

LOADED = "import sys, fleet.site.asgi; print('teleop.stop.views' in sys.modules)"


def test_the_web_process_knows_its_addresses_at_start(tmp_path):
    environment = {"FLEET_DEBUG": "1", "FLEET_VAR": str(tmp_path), "DJANGO_SETTINGS_MODULE": "fleet.settings"}
    tmp_path.chmod(0o700)
    process = subprocess.run(
        [sys.executable, "-c", LOADED],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert process.stdout.split()[-1] == "True"
