"""A WebSocket about one robot, for as long as its person may see that robot."""

from __future__ import annotations

from uuid import UUID, uuid4

from django.utils import timezone

from fleet.accounts.models import User
from robots.registry.selectors import robots_visible_to
from robots.wire import BridgeGone, Ended, Offers, Refusal, Refused
from teleop.background.database import in_database
from teleop.background.tasks import run_in_background
from teleop.control.selectors import SignIn, rights_of, robot_entry
from teleop.control.status import ControlStatus, Rights, RobotEntry
from teleop.live import notices, robot_hub
from teleop.live.socket import CloseCode, MessageSocket
from teleop.recording.refusals import RefusedRequest


class RobotSocket(MessageSocket):
    """Base of what is opened about one robot: one member of its hub (`robot_hub.Member`), which hears nothing yet."""

    through: str  # what this door is called on record
    hub: robot_hub.RobotHub
    person: SignIn
    user: User
    rights: Rights

    def __init__(self) -> None:
        super().__init__()
        self.id = uuid4().hex
        self.name = ""
        self.looks = False

    async def find_robot(self) -> RobotEntry | None:
        """The robot of this address, if there is one that this person may see; else the connection is closed."""
        slug = self.scope["url_route"]["kwargs"]["slug"]
        self.person = (UUID(str(self.scope["user"].pk)), self.scope["session"].session_key or "")
        found = await in_database(_find, slug, self.person)
        if found is None:
            await self.close(CloseCode.NOT_FOUND, "There is no such robot, or you may not see it.")
            return None
        self.user, self.robot_id, entry, self.rights = found
        self.name = self.user.display_name
        return entry

    @property
    def entered(self) -> bool:
        """Whether the robot was found, and its hub entered."""
        return hasattr(self, "hub")

    def denied(self, of: str, refusal: Refusal) -> RefusedRequest | None:
        """By this person at this robot, in the control session that they have here."""
        if not self.entered:
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

    async def cut_off(self, refusal: Refusal) -> None:
        """This person may not even look any more."""
        await self.tell(notices.cut_off(refusal))
        code = CloseCode.NOT_PERMITTED if self.rights.alive else CloseCode.SIGNED_OUT
        await self.close(code, refusal.text)

    # --- what the hub says (robot_hub.Member) -----------------------------------------------------------

    @property
    def held_session(self) -> UUID | None:
        """None: this has no control."""
        return None

    @property
    def fence(self) -> int | None:
        """The fencing number of its control."""
        return None

    @property
    def closely(self) -> bool:
        """Whether this person's rights are looked at each time."""
        return self.held_session is not None

    async def stands(self, status: ControlStatus) -> None:
        """Follow this person's rights."""
        self.rights = status.rights.get(self.person, self.rights)
        if not self.may_look:
            permit = self.rights.permit
            nothing = Refusal("no_role", "You may not look.", "account")
            await self.cut_off(permit if isinstance(permit, Refusal) else nothing)

    @property
    def may_look(self) -> bool:
        """Whether this person may still see the robot."""
        return self.rights.alive and self.rights.role is not None

    async def edited(self, entry: RobotEntry) -> None:
        """The robot was edited."""

    def link_changed(self, up: bool, refusal: Refusal | None) -> None:
        """The link to the bridge came or went."""
        self.tell_if_gone()

    def tell_if_gone(self) -> None:
        """Say that the bridge is away, if it is."""
        refusal = self.hub.entry.refusal or self.hub.link.refusal
        if refusal and not self.hub.link.up:
            run_in_background(self.tell(BridgeGone(refusal, self.hub.link.seen_at, self.hub.link.pending)))

    def offered(self, offers: Offers) -> None:
        """The robot offers something else."""

    def ended_at_bridge(self, ended: Ended) -> None:
        """The bridge ended somebody's control."""

    def refused_at_bridge(self, refused: Refused) -> None:
        """The bridge refused somebody's message."""


def _find(slug: str, person: SignIn) -> tuple[User, UUID, RobotEntry, Rights] | None:
    """The person, the robot if they may see it, and what they may do with it."""
    user = User.objects.get(pk=person[0])
    robot = robots_visible_to(user).filter(slug=slug).first()
    entry = robot_entry(robot.id) if robot else None
    if robot is None or entry is None:
        return None
    return user, robot.id, entry, rights_of([person], robot, timezone.now())[person]
