"""E-mails to people for whom an account was made: a link by which they set their password."""

from __future__ import annotations

from collections.abc import Sequence

from django.core.mail import EmailMessage
from django.urls import reverse
from django.utils.formats import date_format
from django.utils.translation import gettext as _
from django.utils.translation import override

from fleet.accounts import emails
from fleet.accounts.mail.off import is_off
from fleet.accounts.models import User
from fleet.base.languages import of_person
from robots.access.models import Course
from robots.access.password_links import codes_of


def waiting_among(people: Sequence[User]) -> list[User]:
    """Return the people who can set their first password by e-mail."""
    return [one for one in people if one.email and one.is_active and not one.has_usable_password()]


def send_later(people: Sequence[User], *, course: Course, site: str) -> None:
    """Send each person their link after the transaction is committed. The caller does not wait for the mail server.

    Without a mail server, nothing is made or sent.
    """
    reached = [] if is_off() else [person for person in people if person.email]
    codes = codes_of(reached)
    emails.send_later([_message(person, course, f"{site}{path_of(codes[person.pk])}") for person in reached])


def path_of(code: str) -> str:
    """Return the path of a link to set a password."""
    return reverse("welcome", args=[code])


def _message(person: User, course: Course, link: str) -> EmailMessage:
    with override(of_person(person.language)):
        return _in_language(person, course, link)


def _in_language(person: User, course: Course, link: str) -> EmailMessage:
    text = _(
        "Hello %(name)s,\n\n"
        "you are enrolled in the course %(course)s on our robots. Set your password here, within 30 days:\n\n"
        "%(link)s\n\n"
        "Your user name is %(username)s. The course lasts from %(starts)s to %(ends)s.\n"
    )
    facts = {
        "name": person.display_name,
        "course": course.name,
        "link": link,
        "username": person.username,
        "starts": date_format(course.starts_on, "DATE_FORMAT"),
        "ends": date_format(course.ends_on, "DATE_FORMAT"),
    }
    subject = _("Your account for the course %(course)s") % {"course": course.name}
    return EmailMessage(subject, text % facts, to=[person.email])
