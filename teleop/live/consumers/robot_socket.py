"""A WebSocket about one robot, open as long as its person may see that robot."""

from __future__ import annotations

from uuid import UUID

from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope, Token
from fleet.base.web.request_ids import connection_id
from robots.access.selectors import robots_visible_to
from robots.shared.wire import BridgeGone, Refusal
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.allowed.scopes import scope_missing
from teleop.control.selectors import SignIn, rights_of, robot_entry
from teleop.control.status import ControlStatus, Rights, RobotEntry
from teleop.live import notices, robot_hub
from teleop.live.consumers.message_socket import CloseCode, MessageSocket
from teleop.models import named
from teleop.records.refusals import RefusedRequest


class RobotSocket(MessageSocket, robot_hub.Member):
    """Base of the WebSockets about one robot, which are members of its hub."""

    through: str  # name of this interface in the audit log
    hub: robot_hub.RobotHub
    person: SignIn
    user: User
    rights: Rights

    def __init__(self) -> None:
        super().__init__()
        self.id = ""
        self.name = ""
        self.wants_views = False
        self.draws_joints = False

    async def join(self, *scopes: Scope) -> RobotEntry | None:
        """Join the hub of the robot in the address, and return the robot's entry.

        Closes the connection and returns None if this person may not see the robot, or the connection's token has none
        of these scopes (no scopes: any token).
        """
        self.id = connection_id(self.scope["headers"])
        slug = self.scope["url_route"]["kwargs"]["slug"]
        self.person = (UUID(str(self.scope["user"].pk)), self.scope["session"].session_key or "")
        self.token: Token | None = self.scope.get("token")
        found = await in_database(_find, slug, self.person)
        if found is None or (self.token is not None and not self.token.serves(found[1])):
            await self.close(CloseCode.NOT_FOUND, "There is no such robot, or you may not see it.")
            return None
        self.user, self.robot_id, entry, self.rights = found
        self.name = named(self.user.display_name, self.token.name if self.token else None)
        if scopes and not self.opens(*scopes):
            await self.close(CloseCode.NOT_PERMITTED, scope_missing(scopes).text)
            return None
        self.hub = robot_hub.join(self.robot_id, entry, self)
        return entry

    def opens(self, *scopes: Scope) -> bool:
        """Return whether the connection's token has one of these scopes. A page has no token, but all scopes."""
        return self.token is None or any(self.token.opens(scope) for scope in scopes)

    @property
    def joined(self) -> bool:
        """Return whether the robot was found and its hub joined."""
        return hasattr(self, "hub")

    def refused_request(self, of: str, refusal: Refusal) -> RefusedRequest | None:
        """Return the refusal with the person, the robot, and the control session of this connection."""
        if not self.joined:
            return None
        return RefusedRequest(
            self.user,
            self.through,
            of,
            refusal,
            robot_id=self.robot_id,
            robot_name=self.hub.entry.facts.name,
            session_id=self.held_session,
            fence=self.fence,
        )

    async def revoke_access(self, refusal: Refusal) -> None:
        """Close the connection: this person may not see the robot any more."""
        await self.send_message(notices.access_revoked(refusal))
        code = CloseCode.NOT_PERMITTED if self.rights.active else CloseCode.SIGNED_OUT
        await self.close(code, refusal.text)

    # --- reports from the hub (robot_hub.Member) --------------------------------------------------------

    @property
    def fence(self) -> int | None:
        """The fence of its control; None without control."""
        return None

    async def follow(self, status: ControlStatus) -> None:
        """Follow this person's rights."""
        self.rights = status.rights.get(self.person, self.rights)
        if not self.may_see:
            permit = self.rights.permit
            no_role = Refusal("no_role", "You may not see this robot.", "account")
            await self.revoke_access(permit if isinstance(permit, Refusal) else no_role)

    @property
    def may_see(self) -> bool:
        """Return whether this person may still see the robot."""
        return self.rights.active and self.rights.role is not None

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """Inform the client when the bridge is gone."""
        self.report_bridge_gone()

    def report_bridge_gone(self) -> None:
        """Inform the client if the bridge is gone."""
        refusal = self.hub.entry.refusal or self.hub.link.refusal
        if refusal and not self.hub.link.up:
            run_in_background(
                self.send_message(BridgeGone(refusal, self.hub.link.seen_at, self.hub.link.pending))
            )


def _find(slug: str, person: SignIn) -> tuple[User, UUID, RobotEntry, Rights] | None:
    """Return person, robot, entry and rights; None if the person may not see the robot."""
    user = User.objects.get(pk=person[0])
    robot = robots_visible_to(user).filter(slug=slug).first()
    entry = robot_entry(robot.id) if robot else None
    if robot is None or entry is None:
        return None
    return user, robot.id, entry, rights_of([person], robot, timezone.now())[person]
