"""The robot's master comes back with another map: no goal is accepted on the old one."""

from __future__ import annotations

import time

from robots.shared import wire
from tests.processes import REPOSITORY
from tests.sides.navigation.traveller import RENEW_S, travelling
from tests.sides.side import Ros1Side

EAST = (9.2, 2.0)  # a free place of the office; the second world ends before it
WATCHED_S = 12.0
ANSWERS = {"robot_offline", "map_unknown", "no_map", "goal_outside", "base_moving", "no_listener"} | {
    "localisation_missing",
    "localisation_old",
    "watchdog_missing",
    "not_watched",
}


def test_no_goal_is_accepted_on_the_map_before(make_master, simulator, tmp_path):
    office = (REPOSITORY / "robots/simulator/worlds/office.yaml").read_text()
    smaller = tmp_path / "smaller.yaml"
    smaller.write_text(office.replace("[-1.0, -1.0, 11.0, 8.0]", "[-1.0, -1.0, 9.0, 8.0]"))
    master = make_master()
    first = simulator(master=master, pose="2,1.8,0", seed=1)
    config = Ros1Side(master).config(tmp_path, "navigation", "map")
    with travelling(config, master, tmp_path) as traveller:
        hand = traveller.hand
        traveller.until(lambda state: state.location and not state.location.problem, "localisation")
        seq = traveller.go(*EAST)
        assert hand.ask(wire.GoCancel(1, seq + 10_000)) is None
        traveller.ended(seq)
        first.stop()
        master.kill()
        hand.state_until(lambda state: state.phase != "online", "a robot that is gone")
        master.start()
        simulator(master=master, pose="2,1.8,0", seed=1, world=smaller)
        traveller.until(lambda state: state.phase == "online", "a robot that is back")
        until_s, codes = time.monotonic() + WATCHED_S, set()
        while time.monotonic() < until_s:
            refusal = traveller.refused(*EAST)
            assert refusal is not None and refusal.code in ANSWERS, refusal
            codes.add(refusal.code)
            time.sleep(RENEW_S)
        assert codes
