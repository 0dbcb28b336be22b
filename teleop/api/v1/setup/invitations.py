"""Invitations to a course, and e-mails to its people who have no password yet."""

from __future__ import annotations

from datetime import date
from typing import Annotated
from uuid import UUID

from django.shortcuts import get_object_or_404
from django.urls import reverse
from django.utils import timezone
from msgspec import Meta, Struct
from rest_framework.request import Request

from fleet.accounts.mail.off import is_off
from fleet.base.web.origin import public_origin, public_url
from robots.access import enrolment, welcome
from robots.access.models import Invitation
from robots.access.pages.forms import InvitationForm, end_of
from robots.shared.wire import Refusal
from teleop.api.v1.courses import Changed, CoursesBase, PeopleRequest
from teleop.api.v1.framework.operation import entry_of
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import makes, manages

_MAIL_OFF = Refusal(
    "mail_off",
    "The console has no mail server: show or print the links to set a password on the course’s page.",
    "account",
)


class InvitationEntry(Struct, frozen=True):
    """A link by which people enrol themselves. `refusal`: why nobody can join by it any more."""

    id: UUID
    link: str
    made_at: Time
    expires_at: Time
    most_uses: int
    uses: int
    refusal: Refusal | None


class InvitationList(Struct, frozen=True):
    """Invitations, newest first."""

    invitations: list[InvitationEntry]


class InvitationRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new invitation. `last_day`: until when it is valid, included, in the lab's time zone; within a year."""

    last_day: date
    most_uses: Annotated[int, Meta(ge=1, le=5000)] = 40


class InvitationsView(CoursesBase):
    @manages("invitations_list", "List the invitations to a course")
    def get(self, slug: str) -> InvitationList:
        """Also those that are over."""
        found = Invitation.objects.filter(course=self.course(slug)).select_related("course")
        return InvitationList([_entry(self.request, one) for one in found])

    @makes("invitations_make", "Make an invitation", keyed=True)
    def post(self, slug: str, body: InvitationRequest) -> InvitationEntry:
        """Make an invitation: a person who opens its link joins the course, with an account or a new one."""
        form = InvitationForm({"last_day": body.last_day, "most_uses": body.most_uses})
        if not form.is_valid():
            raise Problem(Refusal("invalid", str(next(iter(form.errors.values()))[0]), "wire"))
        made = enrolment.invitation_make(
            course=self.course(slug),
            expires_at=end_of(body.last_day) or timezone.now(),
            most_uses=body.most_uses,
            actor=self.person,
        )
        return _entry(self.request, made)


class InvitationView(CoursesBase):
    @manages("invitations_revoke", "Revoke an invitation")
    def delete(self, slug: str, invitation_id: UUID) -> None:
        """End an invitation: its link admits nobody any more. A repeated call changes nothing."""
        invitations = Invitation.objects.select_related("course").filter(course=self.course(slug))
        found = get_object_or_404(invitations, pk=invitation_id)
        enrolment.invitation_revoke(invitation=found, actor=self.person)


class WelcomeView(CoursesBase):
    @manages("courses_welcome", "Send people the e-mail with which they set a password", keyed=True)
    def post(self, slug: str, body: PeopleRequest) -> Changed:
        """To those who have no password yet; the answer says how many. Others are left out."""
        if is_off():
            raise Problem(_MAIL_OFF)
        course = self.course(slug)
        people = self.members(course, body.people)
        waiting = welcome.waiting_among(people)
        welcome.send_later(waiting, course=course, site=public_origin(self.request._request))
        return Changed(len(waiting))


def _entry(request: Request, one: Invitation) -> InvitationEntry:
    return entry_of(
        InvitationEntry,
        one,
        link=public_url(request._request, reverse("join", args=[one.code])),
        refusal=enrolment.check_invitation(one, timezone.now()),
    )
