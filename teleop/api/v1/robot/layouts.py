"""Shared layouts of a robot's control page: everybody who sees the robot reads them; its supervisors change them."""

from __future__ import annotations

from typing import Annotated

from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct

from fleet.accounts.layouts import Layout, Panel
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.setup.base import SetupView, makes, manages
from teleop.layouts import services
from teleop.models import SharedLayout


class LayoutRequest(Layout, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A layout: the contents of its pictures, the largest first; a plot with its topic and fields, "plot /odom pose.x".

    `cells`: none for the page’s own views. `side`: motions and phrases are shown. `stick`: so is the stick. `panels`:
    the panel above the stick, and those at the other side, above and below.
    """

    name: Annotated[str, Meta(min_length=1, max_length=40)]


class LayoutDetail(Struct, frozen=True):
    """A shared layout: see `LayoutRequest`."""

    number: int
    name: str
    cells: list[str]
    side: bool
    stick: bool
    panels: list[Panel]


class LayoutList(Struct, frozen=True):
    """Shared layouts, by name."""

    layouts: list[LayoutDetail]


class LayoutsView(SetupView):
    @reads("layouts_list", "List the shared layouts of a robot’s page")
    def get(self, slug: str) -> LayoutList:
        """By name."""
        known, _ = self.known_robot(slug)
        return LayoutList([_detail(layout) for layout in known.robot.layouts.all()])

    @makes("layouts_share", "Share a layout of a robot’s page", keyed=True, refuses=(404, 409))
    def post(self, slug: str, body: LayoutRequest) -> LayoutDetail:
        """For staff and supervisors of the robot. A robot has at most 20 shared layouts."""
        robot = self.robot(slug)
        return _detail(services.layout_share(robot=robot, name=body.name, layout=body, actor=self.person))


class LayoutView(SetupView):
    @manages("layouts_delete", "Delete a shared layout")
    def delete(self, slug: str, number: int) -> None:
        """For staff and supervisors of the robot. People who chose it keep it."""
        layout = get_object_or_404(SharedLayout, robot=self.robot(slug), pk=number)
        services.layout_delete(layout=layout, actor=self.person)


def _detail(layout: SharedLayout) -> LayoutDetail:
    return entry_of(LayoutDetail, layout, number=layout.pk)
