"""The holder's two inputs: the page's stick and, while it is at rest, velocities from programs. Pure."""

from __future__ import annotations

from robots.bridge.drive.drive_input import DriveInput, stick_of, velocity_of
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.sentences import say
from robots.shared.wire import Drive, Grant, NeutralNeeded, Refusal


class HolderInputs:
    """Select the input that asks for motion."""

    def __init__(self, config: BridgeConfig) -> None:
        self._config = config
        self.restart()

    def restart(self) -> None:
        """Begin with new inputs: another page, or a reloaded page, begins a new numbering of commands."""
        self.stick = DriveInput(self._config.stick)
        self._twists = DriveInput()

    def take_twist(
        self, velocity: Velocity, order: wire.Publish, grant: Grant, now_s: float
    ) -> Refusal | None:
        """Take a velocity from a program of the holder, converted to a stick position."""
        if order.sent_ms is None:
            text = "A velocity needs sent_ms, the sender’s monotonic clock: old velocities are refused."
            return Refusal("invalid", text, "wire")
        limits = self._config.gate.limits
        stick = stick_of(velocity, limits, grant.max_share, self._config.reverse_steering)
        drive = Drive(order.fence, order.seq, order.sent_ms, stick.x, stick.w, stick.y, share=1.0)
        return self._twists.accept(drive, now_s)

    def wanted(self, grant: Grant, middle_counts: bool, now_s: float) -> tuple[DriveInput | None, Velocity]:
        """Return the input that asks for motion, and its velocity: the stick or, if it is at rest, a twist.

        If `middle_counts` and an input is in the middle now, this input needs neutral no longer. The same
        applies to the other input if its last command was in the middle.
        """
        limits, steering = self._config.gate.limits, self._config.reverse_steering
        wanted = {
            source: velocity_of(drive, limits, grant.max_share, steering)
            for source in (self.stick, self._twists)
            if (drive := source.current(now_s))
        }
        for source, velocity in wanted.items():
            source.is_out = velocity != STILL
        if middle_counts and STILL in wanted.values():
            for source in (self.stick, self._twists):
                if not source.is_out:
                    source.neutral_needed = None
        return next(
            ((source, velocity) for source, velocity in wanted.items() if source.is_out), (None, STILL)
        )

    def neutral_refusal(self, source: DriveInput) -> Refusal | None:
        """Return a refusal if this input needs neutral first."""
        needed = source.neutral_needed
        if needed is None:
            return None
        is_stick = source is self.stick
        figures = {"because": needed.code, "why": needed.text}
        text = (
            say("Let the stick return to the middle: {why}.", why=needed.sentence)
            if is_stick
            else say("Publish a velocity of zero first: {why}.", why=needed.sentence)
        )
        return Refusal("neutral_needed", text, "dead-man", figures)

    def require_neutral(self, code: str, reason: str) -> None:
        """Require neutral of both inputs before the robot moves."""
        for source in (self.stick, self._twists):
            source.require_neutral(code, reason)

    def correct_reason(self, code: str, reason: str) -> None:
        """Replace the reason why neutral is needed, if the reason is a silent input (`dead_man`)."""
        for source in (self.stick, self._twists):
            if source.neutral_needed and source.neutral_needed.code == "dead_man":
                source.neutral_needed = NeutralNeeded(code, reason)
