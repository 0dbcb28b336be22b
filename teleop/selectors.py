"""What the database says about control, as the values that the rules take."""

from __future__ import annotations

from uuid import UUID

from teleop.models import ControlRequest, Lease
from teleop.rules import Ask, Holding, Tab


def holding_of(robot_id: UUID) -> Holding | None:
    """Who has the robot, by the table; it may have lapsed by the clock (`rules.phase`)."""
    lease = (
        Lease.objects.filter(robot_id=robot_id, session__isnull=False)
        .select_related("session__user")
        .first()
    )
    return None if lease is None else _holding(lease)


def holdings() -> list[tuple[UUID, Holding]]:
    """Every robot that somebody has."""
    leases = Lease.objects.filter(session__isnull=False).select_related("session__user")
    return [(lease.robot_id, _holding(lease)) for lease in leases]


def asks_of(robot_id: UUID) -> list[Ask]:
    """Who asks for the robot, oldest first; some may have lapsed (`rules.open_asks`)."""
    requests = ControlRequest.objects.filter(robot_id=robot_id, answered_at=None).select_related("user")
    return [
        Ask(
            id=request.pk,
            user=request.user.id,
            name=request.user.display_name,
            tab=Tab(request.tab, request.sign_in, request.connection),
            asked_at=request.asked_at,
        )
        for request in requests.order_by("asked_at")
    ]


def _holding(lease: Lease) -> Holding:
    session = lease.session
    if session is None or lease.term_ends_at is None or lease.seen_at is None:
        raise ValueError(f"lease of robot {lease.robot_id} is held but incomplete")
    return Holding(
        session=session.id,
        user=session.user.id,
        name=session.user.display_name,
        tab=Tab(lease.tab, lease.sign_in, lease.connection),
        fence=session.fence,
        term_ends_at=lease.term_ends_at,
        seen_at=lease.seen_at,
    )
