"""Checks whether a robot can be driven from this computer. Each check has a result and a remedy.

The probe (`network.probe` of the robot's side) collects facts in a separate process, in the environment of the robot's
bridge; `judge` makes results from the facts. The web process never imports ROS.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
from django.conf import settings
from django.utils.translation import gettext as _

from fleet.base.formats.sentences import in_words
from robots.check.judgement import judge
from robots.check.plan import plan_for
from robots.check.results import FAIL, WARN, Check
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot
from robots.registry.selectors import bridge_config, socket_path
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import side_command
from robots.shared.processes.probe_findings import Findings
from robots.shared.sentences import reason_of
from robots.supervisor.ros_environment import WrapperMissing, ros_environment
from robots.supervisor.unready import Unready

PROBE_TIMEOUT_S = 20.0
_findings = msgspec.json.Decoder(Findings)


def run_checks(robot: Robot) -> list[Check]:
    """Run all checks and return their results; this takes a few seconds."""
    try:
        config = bridge_config(robot)
        environment = ros_environment(config, settings.FLEET_RUN_DIR)
    except Problems as problems:
        return [
            Check(
                _("registry"),
                FAIL,
                in_words(reason_of(problems)),
                _("Correct the robot’s entry or its profile."),
            )
        ]
    except WrapperMissing as error:
        return [
            Check(
                _("host aliases"),
                FAIL,
                in_words(reason_of(error)),
                _("Install it on the console’s computer."),
            )
        ]
    except Unready as error:
        advice = _("Do this on the computer of the robot’s bridge.")
        return [Check(_("software"), FAIL, in_words(reason_of(error)), advice)]
    except OSError as error:
        text = _("The console cannot save them (%s).") % error.strerror
        return [Check(_("host aliases"), FAIL, text, _("Is the disk of the console’s computer full?"))]
    try:
        findings = _probe(config, environment)
        if elsewhere := list(_elsewhere(robot)):
            # The robot calls the bridge's computer back, not this one.
            findings = msgspec.structs.replace(findings, callback=None)
        return [*elsewhere, *judge(config, findings)]
    except subprocess.TimeoutExpired:
        text = _("No answer within %d s.") % PROBE_TIMEOUT_S
        return [Check(_("probe"), FAIL, text, _("Is the network overloaded?"))]
    except (subprocess.CalledProcessError, msgspec.DecodeError) as error:
        return [Check(_("probe"), FAIL, _("The probe failed: %s") % error, _("See the console’s log."))]


def _elsewhere(robot: Robot) -> Iterator[Check]:
    if robot.bridge_address and not Path(socket_path(robot.id)).exists():
        yield Check(
            _("other computer"),
            WARN,
            _("This computer ran the check, but the robot’s bridge runs at %s.") % robot.bridge_address,
            _("Run sudo script/manage check_robot %s on that computer.") % robot.slug,
        )


def _probe(config: BridgeConfig, environment: dict[str, str]) -> Findings:
    done = subprocess.run(  # noqa: S603  (the console's own module)
        side_command(config.ros, "network.probe"),
        input=msgspec.json.encode(plan_for(config)),
        stdout=subprocess.PIPE,
        env=environment,
        cwd=settings.BASE_DIR,
        timeout=PROBE_TIMEOUT_S,
        check=True,
    )
    return _findings.decode(done.stdout)
