"""The owner of the phrases that a command reads or writes."""

from __future__ import annotations

from typing import Any

from django.core.management.base import CommandError, CommandParser

from robots.registry.models import Robot, RobotProfile


def add_owner_arguments(parser: CommandParser) -> None:
    """Add --profile and --robot; exactly one is required."""
    owner = parser.add_mutually_exclusive_group(required=True)
    owner.add_argument("--profile", metavar="SLUG", help="phrases of every robot of this kind")
    owner.add_argument("--robot", metavar="SLUG", help="phrases of this robot only")


def owner_in(options: dict[str, Any]) -> RobotProfile | Robot:
    """Return the named profile or robot."""
    kind, slug = (Robot, options["robot"]) if options["robot"] else (RobotProfile, options["profile"])
    owner: RobotProfile | Robot | None = kind.objects.filter(slug=slug).first()
    if owner is None:
        raise CommandError(f"There is no {kind._meta.verbose_name} {slug}.")
    return owner
