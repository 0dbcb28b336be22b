"""E-mails to people for whom an account was made: a link by which they set their password."""

from __future__ import annotations

from collections.abc import Sequence
from uuid import UUID

from django.core import signing
from django.core.mail import EmailMessage
from django.urls import reverse
from django.utils.crypto import constant_time_compare, salted_hmac
from django.utils.formats import date_format
from django.utils.translation import gettext as _
from django.utils.translation import override

from fleet.accounts import emails
from fleet.accounts.models import User
from fleet.base.languages import of_person
from robots.access.models import Course

SALT = "robots.access.welcome"
VALID_S = 30 * 24 * 3600


def token_of(user: User) -> str:
    """Return the secret of the person's link. It is valid for `VALID_S`, until the person sets a password."""
    return signing.dumps([user.pk.hex, _mark(user)], salt=SALT)


def person_of_token(token: str) -> User | None:
    """Return the person of a link; None if the link is not valid, or not any more."""
    try:
        key, mark = signing.loads(token, salt=SALT, max_age=VALID_S)
    except signing.BadSignature:
        return None
    user = User.objects.filter(pk=UUID(hex=key), is_active=True, project="").first()
    holds = user is not None and not user.has_usable_password() and constant_time_compare(mark, _mark(user))
    return user if holds else None


def _mark(user: User) -> str:
    return salted_hmac(SALT, user.password).hexdigest()[:16]


def waiting_among(people: Sequence[User]) -> list[User]:
    """Return the people who can set their first password by e-mail."""
    return [one for one in people if one.email and one.is_active and not one.has_usable_password()]


def send_later(people: Sequence[User], *, course: Course, site: str) -> None:
    """Send each person their link after the transaction is committed. The caller does not wait for the mail server."""
    emails.send_later([_message(person, course, site) for person in people if person.email])


def _message(person: User, course: Course, site: str) -> EmailMessage:
    with override(of_person(person.language)):
        return _in_language(person, course, site)


def _in_language(person: User, course: Course, site: str) -> EmailMessage:
    link = f"{site}{reverse('welcome', args=[token_of(person)])}"
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
