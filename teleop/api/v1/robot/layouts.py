"""Shared layouts of a robot's control page: everybody who sees the robot reads them; its supervisors change them."""

from __future__ import annotations

from typing import Annotated, Literal

from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct

from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.setup.base import SetupView, makes, manages
from teleop.layouts import services
from teleop.models import SharedLayout


class LayoutRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A layout: the contents of its pictures, the largest first, and whether the lists beside them are shown."""

    name: Annotated[str, Meta(min_length=1, max_length=40)]
    cells: Annotated[list[Literal["camera", "plan", "map", "scene", "second", "plot"]], Meta(max_length=4)]
    side: bool = True


class LayoutDetail(Struct, frozen=True):
    """A shared layout. Without cells: the page's own views."""

    number: int
    name: str
    cells: list[str]
    side: bool


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
        return _detail(
            services.layout_share(
                robot=robot, name=body.name, cells=list(body.cells), side=body.side, actor=self.person
            )
        )


class LayoutView(SetupView):
    @manages("layouts_delete", "Delete a shared layout")
    def delete(self, slug: str, number: int) -> None:
        """For staff and supervisors of the robot. People who chose it keep it."""
        layout = get_object_or_404(SharedLayout, robot=self.robot(slug), pk=number)
        services.layout_delete(layout=layout, actor=self.person)


def _detail(layout: SharedLayout) -> LayoutDetail:
    return entry_of(LayoutDetail, layout, number=layout.pk)
