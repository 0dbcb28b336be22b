"""Check commands against the lease: one grant, its fence and its end. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from robots.shared.sentences import say
from robots.shared.wire import Grant, Refusal


@dataclass
class LeaseGuard:
    """The grant in force and the highest fence ever seen."""

    highest: int
    current: Grant | None = None
    last: Grant | None = None  # the grant in force, or the last grant that was in force
    link: int | None = None  # the link of the grant: only commands from this link are accepted
    ends_s: float = float("-inf")

    def refuse_grant(self, grant: Grant) -> Refusal | None:
        """Return why `grant` is refused; None if it may be taken."""
        if grant.fence < self.highest:
            holder = self.current.holder if self.current else None
            return Refusal(
                "old_fence",
                say(
                    "Control number {fence} has ended; the newest is {highest}.",
                    fence=grant.fence,
                    highest=self.highest,
                ),
                "lease",
                {"fence": grant.fence, "highest": self.highest, "holder": holder},
            )
        last = self.last
        if last and grant.fence == last.fence and grant.session != last.session:
            return Refusal(
                "fence_taken",
                say("Control number {fence} belongs to {holder}.", fence=grant.fence, holder=last.holder),
                "lease",
                {"fence": grant.fence, "holder": last.holder},
            )
        return None

    def enforce(self, grant: Grant, link: int, now_s: float) -> None:
        """Put `grant` in force. Call `refuse_grant` first."""
        self.highest = max(self.highest, grant.fence)
        self.current = self.last = grant
        self.link = link
        self.ends_s = now_s + grant.seconds

    @property
    def confirmed_s(self) -> float:
        """Time at which the holder was last known to be there.

        A web process renews the grant every second, and each renewal reports how long the holder's client has
        been silent.
        """
        if self.current is None:
            return float("-inf")
        return self.ends_s - self.current.seconds - (self.current.silent_s or 0.0)

    def end_grant(self) -> Grant | None:
        """End the grant in force and return it."""
        ended, self.current, self.link = self.current, None, None
        return ended

    def expired(self, now_s: float) -> bool:
        """Return whether the grant in force has expired by the bridge's own clock."""
        return self.current is not None and now_s >= self.ends_s

    def refuse_command(self, fence: int, link: int, now_s: float) -> Refusal | None:
        """Return why a command under `fence` is refused; None if it is accepted."""
        if self.current is None or self.expired(now_s):
            return Refusal(
                "no_lease", "This robot is not under control: take control first.", "lease", {"fence": fence}
            )
        if fence != self.current.fence:
            return Refusal(
                "old_fence" if fence < self.current.fence else "unknown_fence",
                say("Control is with {holder} now.", holder=self.current.holder),
                "lease",
                {"fence": fence, "highest": self.highest, "holder": self.current.holder},
            )
        if link != self.link:
            return Refusal(
                "other_link", "You hold control through another connection.", "lease", {"fence": fence}
            )
        return None
