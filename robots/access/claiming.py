"""A person of a course's list who opens its invitation gets the account that the list made, and no second one.

The person types the e-mail address or student number of the list. This is no proof, so the account is given away only
while it holds nothing that the invitation does not give anyway: nobody has used it, and it has no right outside this
course (`untouched`). An account with a password signs in; one with more rights needs its own link.
"""

from __future__ import annotations

from django.core.cache import cache
from django.db.models import Q
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.sign_in import throttle
from fleet.audit.services import record
from robots.access.enrolment import EnrolmentRefused, words_of
from robots.access.models import Course, Invitation, QualificationGrant
from robots.access.password_links import codes_of, untouched
from robots.shared.wire import Refusal

RECORDED_S = (
    3600  # pauses between two records of one person: a stranger may press the button any number of times
)
_SIGN_IN = Refusal("has_account", "You have an account already: sign in with it, then join.", "account")
_OWN_LINK = Refusal(
    "own_link_needed",
    "You are on the list, and your account may do more than this course. Ask your teacher or the staff for your own "
    "link to set its password.",
    "account",
)
_NOBODY = Refusal(
    "not_on_list",
    "Nobody on the course’s list has this e-mail address or student number. Look whether you typed it as your "
    "institution has it; if you are not on the list, make a new account.",
    "account",
)


def has_unclaimed(course: Course) -> bool:
    """Return whether the list of the course made accounts that nobody has used yet."""
    return bool(untouched(User.objects.filter(enrolments__course=course, last_login=None)))


def claim(*, invitation: Invitation, typed: str, address: str) -> str:
    """Return the code of the link by which a person of the course's list sets a password. Recorded.

    Raises:
        EnrolmentRefused: nobody has this address or number, or the account is not given away like this.
        throttle.TooMany: too many wrong ones came from the network address `address`.

    """
    course, typed = invitation.course, typed.strip()
    with throttle.attempt(username=typed, address=address):
        person = _enrolled(course, typed)
        if person is None:
            throttle.failure_recorded(username=typed, address=address)
            raise EnrolmentRefused(_NOBODY)
    if person.has_usable_password() or person.last_login:
        raise EnrolmentRefused(_SIGN_IN)
    granted = Q(expires_at=None) | Q(expires_at__gt=timezone.now())
    if (
        not untouched([person], {course.pk})
        or QualificationGrant.objects.filter(granted, person=person).exists()
    ):
        raise EnrolmentRefused(_OWN_LINK)
    if cache.add(f"claimed-{person.pk}", True, RECORDED_S):
        parameters = {"course": course.slug, "people": [str(person.pk)], "invitation": str(invitation.pk)}
        record("account.link", actor=None, parameters=parameters)
    return codes_of([person], seen=True)[person.pk]


def _enrolled(course: Course, typed: str) -> User | None:
    people = User.objects.filter(enrolments__course=course)
    if not typed:
        return None
    if "@" in typed:
        return people.filter(email=typed.lower()).first()
    return User.objects.filter(enrolments__course=course, enrolments__number=typed).first()


def namesake(course: Course, name: str) -> bool:
    """Return whether somebody in the course has this name, whatever the order of its words."""
    names = User.objects.filter(enrolments__course=course).values_list("full_name", flat=True)
    return words_of(name) in {words_of(one) for one in names if one}
