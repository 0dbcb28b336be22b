"""Selects the velocity input that drives the base by twist_mux's rules, without ROS.

An input is active for `INPUT_TIMEOUT_S` after its last message; the active input of highest priority
that no lock masks drives the base. A lock masks inputs of a lower priority. Active inputs of equal
priority all pass (as in twist_mux).
"""

from __future__ import annotations

from collections.abc import Mapping

INPUT_TIMEOUT_S = 0.5

TIAGO_INPUTS: Mapping[str, int] = {
    "joy_vel": 100,
    "tab_vel": 100,
    "marker_vel": 99,
    "phone_vel": 98,
    "rviz_joy_vel": 95,
    "key_vel": 90,
    "servoing_cmd_vel": 20,
    "nav_vel": 10,
}

# The same, except navigation's.
TIAGO_INPUTS_ROS2: Mapping[str, int] = {
    "cmd_vel" if name == "nav_vel" else name: priority for name, priority in TIAGO_INPUTS.items()
}

TIAGO_LOCKS: Mapping[str, int] = {
    "stop_closing_loop": 200,
    "pause_navigation": 100,
    "joy_priority": 100,
    "emergency_brake": 100,
}


class TwistMux:
    """Keeps each input's last time and the active locks. Times are seconds of one monotonic clock."""

    def __init__(self, inputs: Mapping[str, int] = TIAGO_INPUTS) -> None:
        self._inputs = inputs
        self._heard_at: dict[str, float] = {}
        self._locked: set[str] = set()

    def lock(self, name: str, on: bool) -> None:
        """Set or lift a lock."""
        if name not in TIAGO_LOCKS:
            raise KeyError(name)
        if on:
            self._locked.add(name)
        else:
            self._locked.discard(name)

    def passes(self, name: str, now: float) -> bool:
        """Note a command of input `name` at `now`; return whether it passes to the base."""
        priority = self._inputs[name]
        self._heard_at[name] = now
        return priority >= self._highest_lock() and priority == self._highest_speaking(now)

    def _highest_lock(self) -> int:
        return max((TIAGO_LOCKS[name] for name in self._locked), default=0)

    def _highest_speaking(self, now: float) -> int:
        speaking = (self._inputs[name] for name, at in self._heard_at.items() if now - at <= INPUT_TIMEOUT_S)
        return max(speaking, default=0)
