"""Reading the registry."""

from __future__ import annotations

import math
from itertools import chain, count
from typing import cast
from urllib.parse import urlsplit
from uuid import UUID

from django.conf import settings
from django.db.models import Model, Q
from django.utils.text import slugify
from msgspec import Struct, structs

from fleet.audit.models import Record
from fleet.base.database import rows
from fleet.base.names import RESERVED
from fleet.base.version import version
from robots.link.authority import own_files
from robots.registry.configuration import robot_config
from robots.registry.configuration.addresses import check_master_uri
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Allowance, Robot, RobotProfile, RosChoice
from robots.registry.phrases import FALLBACK_LANGUAGE, Line, tags_in
from robots.shared import wire
from robots.shared.configuration.bridge_config import (
    Allowed,
    BridgeConfig,
    LimbSource,
    LinkAddress,
    RecordingPlace,
    Topics,
    What,
)
from robots.shared.configuration.denylist import admissible
from robots.shared.configuration.gate_profile import GateProfile, Parameters
from robots.shared.configuration.input_filters import describe
from robots.shared.configuration.robot_ros import Discovery, Ros, Ros1, Ros2
from robots.shared.sentences import say
from robots.shared.wire import CameraEntry, LimbRange, Limits, ReverseSteering, RobotFacts, SonarPose, Use

DISC_CORNERS = 32  # number of corners of the polygon that is drawn for a disc


class RobotRow(Struct, frozen=True):
    """A robot in a list."""

    id: UUID
    slug: str
    name: str
    profile: str  # slug
    practice: bool
    enabled: bool


_ROBOTS = """
SELECT r.id, r.slug, r.name, p.slug, r.practice, r.enabled
FROM robots_robot r JOIN robots_robotprofile p ON p.id = r.profile_id ORDER BY r.name
"""
_PHRASES = """
SELECT id, text, language, tags FROM robots_phrase WHERE profile_id = %s OR robot_id = %s
ORDER BY robot_id IS NOT NULL, "order", id
"""


def robot_rows() -> list[RobotRow]:
    """Return all robots by name, without a check who may see them. Makes one query."""
    return [RobotRow(rows.key(key), *others) for key, *others in rows.read(_ROBOTS, [])]


def phrases_of(robot: Robot) -> list[tuple[int, Line]]:
    """Return the robot's phrases, each with its key: the profile's, then the robot's own. Makes one query."""
    found = rows.read(_PHRASES, [robot.profile_id, robot.id])
    return [(key, Line(text, language, tags_in(tags))) for key, text, language, tags in found]


def first_language(owner: Robot | RobotProfile) -> str:
    """Return the language of phrases without one: the first language of the robot or profile."""
    try:
        topics = (
            robot_config.topics(owner) if isinstance(owner, Robot) else robot_config.profile_topics(owner)
        )
    except Problems:
        return FALLBACK_LANGUAGE
    return next(iter(topics.languages), FALLBACK_LANGUAGE)


def allowed_on(robot: Robot) -> tuple[Allowed, ...]:
    """Return the allow-list of a robot: its own entries replace the profile's. Raises `Problems`."""
    return _admitted(robot, robot_config.topics(robot))


def _admitted(robot: Robot, topics: Topics) -> tuple[Allowed, ...]:
    """Return the entries, without those that the denylist forbids since an edit of the profile."""
    kinds = Q(profile=robot.profile_id)
    entries = Allowance.objects.filter(kinds | Q(robot=robot))
    given = [
        Allowed(
            cast(What, entry.what),
            entry.name if entry.robot_id else robot_config.in_namespace(robot, entry.name),
            entry.type,
            cast(Use, entry.use),
            cast(wire.Role, entry.role),
        )
        for entry in sorted(entries, key=lambda entry: entry.robot_id is not None)
    ]
    by_name = {(entry.what, entry.use, entry.name): entry for entry in given}
    return admissible((by_name[key] for key in sorted(by_name)), topics)


def last_editor(entry: Robot | RobotProfile) -> str:
    """Return the name of the person who changed the entry last, from the audit log."""
    changes = (
        Record.objects.filter(kind="robot.change", robot_id=entry.id)
        if isinstance(entry, Robot)
        else Record.objects.filter(kind="profile.change", parameters__profile=entry.slug)
    )
    return changes.order_by("-id").values_list("actor__name", flat=True).first() or "somebody"


def socket_path(robot_id: UUID) -> str:
    """Return the Unix socket on which the bridge of a robot listens on this computer."""
    return str(settings.FLEET_RUN_DIR / f"{robot_id.hex[:12]}.sock")


def link_address(robot: Robot) -> LinkAddress:
    """Return the addresses on which the robot's bridge listens, with what a web process needs to connect."""
    near = LinkAddress(unix_path=socket_path(robot.id))
    if not robot.bridge_address:
        return near
    parts = urlsplit(robot.bridge_address)
    return structs.replace(
        near,
        host=parts.hostname,
        port=parts.port,
        secret=settings.FLEET_LINK_SECRET,
        authority=settings.FLEET_LINK_CA,
    )


def require_link_settings(robot: Robot) -> None:
    """Raise `Problems` if the robot's bridge listens on the network, but secret, certificate or key is not set."""
    if not robot.bridge_address:
        return
    needed = ["FLEET_LINK_SECRET"]
    if not _has_own_certificate(link_address(robot)):
        needed = ["FLEET_LINK_CERT", "FLEET_LINK_KEY", *needed]
    missing = [name for name in needed if not getattr(settings, name)]
    if missing:
        names = ", ".join(missing)
        raise Problems([say("A bridge that listens on the network needs {names} to be set.", names=names)])


def _has_own_certificate(address: LinkAddress) -> bool:
    """Return whether the console's link authority certifies this computer, because no settings name a certificate."""
    given = settings.FLEET_LINK_CERT or settings.FLEET_LINK_KEY or settings.FLEET_LINK_CA
    return not given and bool(address.host) and address.host == settings.FLEET_BRIDGE_HOST


def _listening(address: LinkAddress) -> LinkAddress:
    """Return the address with the certificate and key of the bridge."""
    certificate, key = settings.FLEET_LINK_CERT, settings.FLEET_LINK_KEY
    if address.host and _has_own_certificate(address):
        certificate, key = own_files(settings.FLEET_VAR, address.host)
    return structs.replace(address, certificate=certificate, private_key=key) if address.host else address


def bridge_config(robot: Robot) -> BridgeConfig:
    """Return the configuration of the robot's bridge. Raises `Problems` if the robot's entry is wrong."""
    ros = _ros(robot)
    known = robot_config.of(robot)
    return BridgeConfig(
        robot_id=str(robot.id),
        slug=robot.slug,
        name=robot.name,
        ros=ros,
        topics=known.topics,
        gate=known.gate,
        reverse_steering=cast(ReverseSteering, robot.profile.reverse_steering),
        link=_listening(link_address(robot)),
        allowed=_admitted(robot, known.topics),
        stick=known.stick,
        state_dir=str(settings.FLEET_VAR / "bridges"),
        run_dir=str(settings.FLEET_RUN_DIR),
        recordings=_recording_place(),
        last_fence=robot.fence,
    )


def _ros(robot: Robot) -> Ros:
    if robot.profile.ros == RosChoice.ONE:
        # An entry of an earlier version may have an address that is refused now
        check_master_uri(robot.master_uri)
        return Ros1(robot.master_uri.rstrip("/"), robot.advertised_address or None, robot.host_aliases)
    return Ros2(
        domain_id=robot.domain_id,
        discovery=cast(Discovery, robot.discovery),
        static_peers=tuple(robot.static_peers.split()),
        discovery_server=robot.discovery_server,
        namespace=robot.namespace,
        setup=robot.ros_setup,
    )


def _recording_place() -> RecordingPlace | None:
    if settings.FLEET_RECORDINGS is None:
        return None
    return RecordingPlace(
        str(settings.FLEET_RECORDINGS),
        settings.FLEET_RECORDINGS_BYTES,
        settings.FLEET_RECORDINGS_FREE_BYTES,
        version(),
    )


def robot_facts(robot: Robot) -> RobotFacts:
    """Return the facts of a robot for a page.

    If the robot's entry is wrong, use only its columns and its profile's: the page must still show the error and stop
    the robot.
    """
    try:
        known = robot_config.of(robot)
    except Problems:
        known = None
    limits = known.gate.limits if known else robot.profile
    sonars = known.topics.sonars if known else []
    margins = known.gate.parameters if known else Parameters()
    return RobotFacts(
        slug=robot.slug,
        name=robot.name,
        profile=robot.profile.kind,
        practice=robot.practice,
        holonomic=robot.profile.holonomic,
        limits=Limits(limits.forward_mps, limits.reverse_mps, limits.lateral_mps, limits.turn_radps),
        footprint=_drawn(known.gate) if known else [],
        front_margin_m=margins.front_margin_m,
        lateral_margin_m=margins.lateral_margin_m,
        default_share=known.default_share if known else robot.profile.default_share,
        max_share=robot.max_share,
        reverse_steering=cast(ReverseSteering, robot.profile.reverse_steering),
        drive_topic=robot_config.in_namespace(robot, robot.drive_topic or robot.profile.drive_topic),
        has_head=known is not None and known.topics.head is not None,
        has_map=known is not None and None not in (known.topics.map, known.topics.navigation),
        cameras=_cameras(known.topics) if known else [],
        limbs={limb: limb_range(source) for limb, source in known.topics.limbs.items()} if known else {},
        sonars=[SonarPose(sonar.frame_id, *sonar.pose, sonar.fov) for sonar in sonars],
        stick=describe(known.stick if known else ()),
        ros=robot.profile.ros,
    )


def limb_range(limb: LimbSource) -> LimbRange:
    """Return the lowest and highest position of a limb (m, sum over its joints)."""
    low, high = (round(len(limb.joints) * end, 4) for end in limb.range_m)
    return LimbRange(low, high)


def _cameras(topics: Topics) -> list[CameraEntry]:
    return [
        CameraEntry(camera.name, camera.label or camera.name, camera.moves and topics.head is not None)
        for camera in topics.cameras
    ]


def _drawn(body: GateProfile) -> list[tuple[float, float]]:
    """Return the footprint's outline; a disc becomes a polygon."""
    if body.outline is not None:
        return list(body.outline)
    radius_m = body.radius_m or 0.0
    angles = [2.0 * math.pi * corner / DISC_CORNERS for corner in range(DISC_CORNERS)]
    return [(round(radius_m * math.cos(angle), 4), round(radius_m * math.sin(angle), 4)) for angle in angles]


def free_slug(model: type[Model], name: str) -> str:
    """Return a slug for an entry with this name that no other entry of the model has: "tiago-1", or "tiago-1-2"."""
    begins = slugify(name)[:40] or model._meta.model_name or "entry"
    taken = set(model._default_manager.filter(slug__startswith=begins).values_list("slug", flat=True))
    free = chain([begins], (f"{begins}-{n}" for n in count(2)))
    return next(slug for slug in free if slug not in taken | RESERVED | {"new"})
