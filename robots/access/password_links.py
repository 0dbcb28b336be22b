"""Personal links by which people set a password: for new accounts, and, by staff, for a forgotten password.

Whoever has a link gets the account. So a supervisor sees links only of accounts from which nothing can be gained:
nobody has used them yet, and all that they may do comes from courses of this supervisor (`untouched`). Such a link
ends when the account gains anything by other hands: sheets lie around (`_valid`). Staff, who may set every password,
see every link but their own. A sign-in ends every link.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import timedelta
from uuid import UUID

from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from cryptography.fernet import InvalidToken
from django.db import transaction
from django.utils import timezone
from django.utils.crypto import constant_time_compare, get_random_string, salted_hmac

from fleet.accounts import services
from fleet.accounts.models import User
from fleet.accounts.sign_in.secrets import decrypted, encrypted
from fleet.audit.services import record
from fleet.base.zones import end_of
from robots.access.models import CODE_LETTERS, Course, Enrolment, GroupRole, PasswordLink, QualificationGrant
from robots.access.selectors import courses_managed_by, lab_date
from robots.registry.models import RobotRole

VALID = timedelta(days=30)
SALT = "robots.access.password_links"


# --- who may see a link ---------------------------------------------------------------------------


def may_see(viewer: User, people: Sequence[User]) -> set[UUID]:
    """Return the people whose links `viewer` may see."""
    open_accounts = [one for one in people if one.is_active and not one.project and one != viewer]
    if viewer.is_staff:
        return {one.pk for one in open_accounts}
    managed = set(courses_managed_by(viewer).values_list("pk", flat=True))
    inside = Enrolment.objects.filter(course__in=managed, person__in=open_accounts)
    return untouched(open_accounts, managed) & set(inside.values_list("person_id", flat=True))


def untouched(people: Iterable[User], courses: Collection[int] | None = None) -> set[UUID]:
    """Return the people whose accounts nobody has used, and whose rights come from these courses only.

    None: from any courses, as an enrolled person.
    """
    found = {
        one.pk
        for one in people
        if one.is_active
        and not (one.is_staff or one.is_superuser or one.project)
        and not (one.has_usable_password() or one.last_login)
    }
    for table, column in (
        (RobotRole, "user_id"),
        (GroupRole, "user_id"),
        (SocialAccount, "user_id"),
        (Authenticator, "user_id"),
        (Course.supervisors.through, "user_id"),
    ):
        held = table._default_manager.filter(**{f"{column}__in": found})
        found -= set(held.values_list(column, flat=True))
    if courses is not None:
        others = Enrolment.objects.filter(
            person__in=found, course__archived=False, course__ends_on__gte=lab_date()
        )
        found -= set(others.exclude(course__in=courses).values_list("person_id", flat=True))
    return found


# --- making them ----------------------------------------------------------------------------------


@transaction.atomic
def codes_of(
    people: Sequence[User], *, seen: bool = False, viewer: User | None = None, anew: bool = False
) -> dict[UUID, str]:
    """Return the code of each person's link, by person; it is valid for `VALID` from now on.

    `seen`: on a page, by `viewer`; None: by whoever opened an invitation. `anew`: old links end.
    """
    links = {
        link.person_id: link for link in PasswordLink.objects.select_for_update().filter(person__in=people)
    }
    now = timezone.now()
    expires_at = end_of(lab_date(now + VALID), timezone.get_default_timezone())
    valid = set() if anew else _valid({one.pk: one for one in people}, links.values())
    limited = untouched(people) if seen else set()  # others are shown to staff only
    codes: dict[UUID, str] = {}
    for person in people:
        link = links.setdefault(person.pk, PasswordLink(person=person))
        code = _unsealed(link) if person.pk in valid else ""
        if not code:
            code = "-".join(get_random_string(4, CODE_LETTERS) for _group in range(4))  # 79 bits
            link.digest, link.sealed, link.mark = _digest(code), encrypted(code), _mark(person)
            link.seen_at = link.seen_by = None
        if person.pk in limited:
            alone = link.seen_at is None or (viewer and link.seen_by_id == viewer.pk)
            link.seen_at, link.seen_by = now, viewer if alone else None
        link.expires_at = expires_at
        codes[person.pk] = code
    PasswordLink.objects.bulk_create(
        links.values(),
        update_conflicts=True,
        unique_fields=["person"],
        update_fields=["digest", "sealed", "mark", "seen_at", "seen_by", "expires_at"],
    )
    return codes


@transaction.atomic
def shown(people: Sequence[User], *, actor: User, anew: bool) -> dict[UUID, str]:
    """Return `codes_of` for a page that shows the links of these people to `actor`. Recorded."""
    codes = codes_of(people, seen=True, viewer=actor, anew=anew)
    parameters = {"people": [str(one.pk) for one in people], "anew": anew}
    record("account.link", actor=actor, parameters=parameters)
    return codes


def _valid(people: Mapping[UUID, User], links: Iterable[PasswordLink]) -> set[UUID]:
    """Return those of these people whose links are valid.

    One that others have seen ends with an enrolment, a role, or a qualification that its viewer has not granted.
    """
    now = timezone.now()
    holding = [
        link
        for link in links
        if link.expires_at > now and constant_time_compare(link.mark, _mark(people[link.person_id]))
    ]
    seen = {link.person_id: (link.seen_at, link.seen_by_id) for link in holding if link.seen_at}
    ended = seen.keys() - untouched(people[key] for key in seen)
    enrolled = Enrolment.objects.filter(person__in=seen).values_list("person_id", "added_at")
    granted = QualificationGrant.objects.filter(person__in=seen)
    gained = [
        *((key, at, None) for key, at in enrolled),
        *granted.values_list("person_id", "granted_at", "granted_by"),
    ]
    ended |= {key for key, at, by in gained if at > seen[key][0] and (by is None or by != seen[key][1])}
    return {link.person_id for link in holding} - ended


def _unsealed(link: PasswordLink) -> str:
    """Return a link's code; "" if FLEET_SECRET_KEY has changed."""
    try:
        return decrypted(link.sealed)
    except InvalidToken:
        return ""


def _digest(code: str) -> str:
    return hashlib.sha256(code.lower().encode()).hexdigest()


def _mark(user: User) -> str:
    """Return a text that changes with the password and with each sign-in."""
    return salted_hmac(SALT, f"{user.password}{user.last_login or ''}").hexdigest()[:16]


# --- using them -----------------------------------------------------------------------------------


def link_of(code: str) -> PasswordLink | None:
    """Return a valid link; None if it is not valid, or not any more."""
    link = PasswordLink.objects.select_related("person").filter(digest=_digest(code)).first()
    if link is None or not link.person.is_active or link.person.project:
        return None
    return link if _valid({link.person_id: link.person}, [link]) else None


def password_set(link: PasswordLink, person: User) -> bool:
    """Save the person's new password, and end the link. False: the link was used meanwhile.

    A password in place of a forgotten one ends the person's sign-ins and tokens.
    """
    with transaction.atomic():
        if not PasswordLink.objects.filter(pk=link.pk, digest=link.digest).delete()[0]:
            return False
        person.changed_by = person
        person.save()
        services.password_reset(user=person, actor=person, why="password reset", tokens=True)
    return True
