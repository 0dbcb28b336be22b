"""Enrols people in courses, by a list or by an invitation, and takes them out again."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import UUID

from django.db import transaction
from django.dispatch import receiver
from django.utils import timezone
from django.utils.translation import gettext as _
from msgspec import Struct

from fleet.accounts.changes import record_creations
from fleet.accounts.models import User
from fleet.accounts.names import AccountNames
from fleet.accounts.services import erased
from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.services import lock_chain, record
from fleet.base.names import spelled_out
from robots.access import welcome
from robots.access.models import Course, Enrolment, Invitation, PasswordLink
from robots.access.people_lists.reading import Listed, PeopleList, Wrong
from robots.access.selectors import courses_managed_by, lab_date
from robots.access.signals import publish_access_changed
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal

if TYPE_CHECKING:
    from robots.access.services import Actor

T = TypeVar("T")

BATCH_SIZE = 100  # people in one transaction: others must not wait long for the database
NO_NUMBERS: Mapping[UUID, str] = {}
NOT_IN_USERNAMES = re.compile(r"[^\w.@+-]")


class EnrolmentRefused(NotDone):
    """An enrolment is not possible."""


class Undisclosed(Struct, frozen=True):
    """A person of a list who is in no course of the supervisor.

    The supervisor must not learn whether this person has an account.
    """

    listed: Listed
    account: User | None


class Plan(Struct, frozen=True):
    """The effect of a list on a course."""

    known: tuple[User, ...] = ()  # have an account and will be enrolled
    new: tuple[Listed, ...] = ()  # will get an account and an invitation by e-mail
    undisclosed: tuple[Undisclosed, ...] = ()  # will be enrolled, with or without an account
    enrolled: tuple[User, ...] = ()  # are in the course already
    renumbered: tuple[User, ...] = ()  # of these, those whose student number is stored or replaced
    numbers: Mapping[UUID, str] = {}  # student numbers of accounts
    namesakes: frozenset[str] = frozenset()  # keys of people to enrol whose name somebody in the course has
    wrong: tuple[Wrong, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def to_enrol(self) -> int:
        """Return the number of people who will be enrolled."""
        return len(self.known) + len(self.new) + len(self.undisclosed)

    @property
    def accounts(self) -> list[User]:
        """Return the accounts that will be enrolled."""
        return [*self.known, *(one.account for one in self.undisclosed if one.account is not None)]

    @property
    def newcomers(self) -> list[Listed]:
        """Return the people who will get an account."""
        return [*self.new, *(one.listed for one in self.undisclosed if one.account is None)]


def plan_of(
    people: PeopleList, course: Course | None, actor: User, names: AccountNames | None = None
) -> Plan:
    """Return the effect of a list on a course; None: the course does not exist yet.

    `names`: those of all accounts now; None: they are read. Those of new people are added.

    Staff see who has an account. Supervisors see this only for people in their courses. Other people are enrolled even
    if their account is closed: an error would show that the account exists, and a closed account has no role anyway.
    """
    found = _Accounts(people, course, actor)
    familiar = None if actor.is_staff else found.familiar
    known: list[User] = []
    enrolled: list[User] = []
    renumbered: list[User] = []
    new: list[Listed] = []
    undisclosed: list[Undisclosed] = []
    wrong, names, numbers = list(people.wrong), names or AccountNames(User), dict[UUID, str]()
    for one in people.people:
        account = found.account(one)
        disclosed = familiar is None or (account is not None and account.pk in familiar)
        if fault := found.fault(one, account):
            wrong.append(Wrong(one.line, one.key, fault, one.cells))
            continue
        if (account is None or not disclosed) and (named := names.fault_of_name(one.name)):
            wrong.append(Wrong(one.line, one.key, f"{spelled_out(one.name[:60])}: {named.text}", one.cells))
            continue
        names.add("", one.name)
        if account is not None and one.number:
            numbers[account.pk] = one.number
        if not disclosed:
            undisclosed.append(Undisclosed(one, account))
        elif account is None:
            new.append(one)
        elif not account.is_active:
            wrong.append(Wrong(one.line, one.key, _("This account is closed. Ask the staff."), one.cells))
        elif account.pk not in found.inside:
            known.append(account)
        else:
            enrolled.append(account)
            if one.number and one.number != found.inside[account.pk]:
                renumbered.append(account)
    wrong.sort(key=lambda one: one.line)
    return Plan(
        known=tuple(known),
        new=tuple(new),
        undisclosed=tuple(undisclosed),
        enrolled=tuple(enrolled),
        renumbered=tuple(renumbered),
        numbers=numbers,
        namesakes=found.namesakes([*new, *(one.listed for one in undisclosed)]),
        wrong=tuple(wrong),
        notes=people.notes,
    )


class _Accounts:
    """The accounts of the people of a list: by address; without one, by student number and name.

    Numbers are looked up only in courses that the actor manages: they say nothing about people of others.
    """

    def __init__(self, people: PeopleList, course: Course | None, actor: User) -> None:
        self._by_address = accounts_by_address(one.email for one in people.people if one.email)
        theirs = Enrolment.objects.filter(course__in=courses_managed_by(actor))
        self.familiar = set(theirs.values_list("person_id", flat=True)) if not actor.is_staff else set()
        self.inside: dict[UUID, str] = {}  # numbers of the course's people
        self._holders: dict[str, User] = {}  # the course's people with a number
        self._by_number: dict[tuple[str, frozenset[str]], User] = {}
        if course is not None:
            self.inside = dict(Enrolment.objects.filter(course=course).values_list("person_id", "number"))
        wanted = [one.number for one in people.people if one.number]
        for part in _parts(wanted, 500):
            for held in theirs.filter(number__in=part).select_related("person"):
                self._by_number[held.number, words_of(held.person.full_name)] = held.person
                if course is not None and held.course_id == course.pk:
                    self._holders[held.number] = held.person

    def account(self, one: Listed) -> User | None:
        """Return the account of a listed person; None: it must be made."""
        by_address = self._by_address.get(one.email) if one.email else None
        return by_address or self._by_number.get((one.number, words_of(one.name)))

    def namesakes(self, people: Iterable[Listed]) -> frozenset[str]:
        """Return the keys of those whose name somebody in the course has: perhaps they have joined by themselves."""
        names = User.objects.filter(pk__in=self.inside).values_list("full_name", flat=True)
        inside = {words_of(name) for name in names if name}
        return frozenset(one.key for one in people if words_of(one.name) in inside)

    def fault(self, one: Listed, account: User | None) -> str:
        """Return why the list contradicts the course: two people would have one number."""
        holder = self._holders.get(one.number)
        if holder is None or holder == account:
            return ""
        return _("%(name)s has this student number in the course.") % {"name": holder.display_name}


def words_of(name: str) -> frozenset[str]:
    """Return the words of a name, by which it is found whatever their order, case and accents."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return frozenset(re.findall(r"\w+", plain))


def accounts_by_address(addresses: Iterable[str]) -> dict[str, User]:
    """Return the accounts with these e-mail addresses, by the address in lower case."""
    parts = _parts([address.lower() for address in addresses], 500)
    return {user.email: user for part in parts for user in User.objects.filter(email__in=part)}


def enrol_list(*, course: Course, people: PeopleList, actor: User, site: str) -> Plan:
    """Enrol the people of a list, and make the accounts that do not exist yet. A repeated call changes nothing.

    Each transaction enrols at most `BATCH_SIZE` people; after an error, call this again. New people get an e-mail with
    a link to set their password; `site` is the address of the console, such as `https://fleet.example.org`.
    """
    names = AccountNames(User)
    plan = plan_of(people, course, actor, names)
    for part in _parts([*plan.accounts, *plan.renumbered], BATCH_SIZE):
        enrol(course=course, people=part, actor=actor, numbers=plan.numbers)
    for listed in _parts(plan.newcomers, BATCH_SIZE):
        with transaction.atomic():
            _lock_enrolments()
            names.catch_up()
            # The button may have been pressed twice
            now = plan_of(PeopleList(tuple(listed)), course, actor, names)
            made = _make_accounts(now.newcomers, actor)
            numbers = {person.pk: one.number for person, one in zip(made, now.newcomers, strict=True)}
            people_now = [*now.accounts, *made]
            enrol(course=course, people=people_now, actor=actor, numbers={**now.numbers, **numbers})
            welcome.send_later(made, course=course, site=site)
    return plan


@transaction.atomic
def enrol(
    *,
    course: Course,
    people: Sequence[User],
    actor: Actor,
    invitation: Invitation | None = None,
    numbers: Mapping[UUID, str] = NO_NUMBERS,
) -> int:
    """Enrol these people, and store their student numbers. Returns how many were not enrolled before."""
    _lock_enrolments()
    inside = set(Enrolment.objects.filter(course=course, person__in=people).values_list("person", flat=True))
    new = [person for person in people if person.pk not in inside]
    if new:
        Enrolment.objects.bulk_create(
            [Enrolment(course=course, person=person) for person in new], ignore_conflicts=True
        )
        by = {"invitation": str(invitation.pk)} if invitation else {}
        parameters = {"course": course.slug, "people": [str(person.pk) for person in new], **by}
        record("course.enrol", actor=actor, parameters=parameters)
    _number(course, {person.pk: numbers[person.pk] for person in people if numbers.get(person.pk)}, actor)
    return len(new)


def _number(course: Course, numbers: Mapping[UUID, str], actor: Actor) -> None:
    """Store student numbers, and record whose changed. A number that another person of the course has is left out."""
    rows = Enrolment.objects.filter(course=course)
    held = set(rows.filter(number__in=numbers.values()).values_list("number", flat=True))
    changed = list(rows.filter(person__in=[key for key, number in numbers.items() if number not in held]))
    for row in changed:
        row.number = numbers[row.person_id]
    if changed:
        Enrolment.objects.bulk_update(changed, ["number"])
        people = [str(row.person_id) for row in changed]
        record("course.number", actor=actor, parameters={"course": course.slug, "people": people})


@transaction.atomic
def unenrol(*, course: Course, people: Sequence[User], actor: Actor) -> int:
    """Take these people out of the course: they lose its role, and control that they have by it.

    Returns how many of them were in the course.
    """
    _lock_enrolments()
    found = Enrolment.objects.select_for_update().filter(course=course, person__in=people)
    gone = [str(person) for person in found.values_list("person", flat=True)]
    if gone:
        found.delete()
        record("course.unenrol", actor=actor, parameters={"course": course.slug, "people": gone})
        publish_access_changed(UUID(person) for person in gone)
    return len(gone)


@receiver(erased)
def _forget(*, user: User, **_options: Any) -> None:
    """Remove an erased person's student numbers and link."""
    Enrolment.objects.filter(person=user).update(number="")
    PasswordLink.objects.filter(person=user).delete()


def _lock_enrolments() -> None:
    """Lock the audit log's chain without a robot until the commit. Each record of these changes locks it, but later.

    With this lock at the beginning, two lists with the same people make each account only once, and there is no
    deadlock.
    """
    lock_chain(NO_ROBOT)


def _make_accounts(people: Sequence[Listed], actor: User) -> list[User]:
    """Make accounts without password. The user name is the e-mail address: people need to remember only one name.

    Without an address, it is the student number.
    """
    names = _free_usernames([NOT_IN_USERNAMES.sub("-", one.key.lower())[:140] for one in people])
    made = []
    for one, username in zip(people, names, strict=True):
        user = User(username=username, email=one.email, full_name=one.name)
        user.set_unusable_password()
        made.append(user)
    User.objects.bulk_create(made)
    record_creations(made, actor)
    return made


def _free_usernames(wanted: list[str]) -> list[str]:
    """Return these names; where another account has the name, with a number at the end."""
    taken = Counter(User.objects.filter(username__in=wanted).values_list("username", flat=True))
    names = []
    for name in wanted:
        taken[name] += 1
        free = name if taken[name] == 1 else f"{name}-{taken[name]}"
        while free != name and (taken[free] or User.objects.filter(username=free).exists()):
            taken[name] += 1
            free = f"{name}-{taken[name]}"
        taken[free] += free != name
        names.append(free)
    return names


# --- invitations ----------------------------------------------------------------------------------


@transaction.atomic
def invitation_make(*, course: Course, expires_at: datetime, most_uses: int, actor: User) -> Invitation:
    """Make a link by which people enrol themselves. Raises `ValidationError`."""
    made = Invitation(course=course, made_by=actor, expires_at=expires_at, most_uses=most_uses)
    made.full_clean()
    made.save()
    record(
        "course.invite",
        actor=actor,
        parameters={
            "course": course.slug,
            "invitation": str(made.pk),
            "expires_at": expires_at.isoformat(),
            "most_uses": most_uses,
        },
    )
    return made


@transaction.atomic
def invitation_revoke(*, invitation: Invitation, actor: User) -> None:
    """End an invitation. A repeated call changes nothing."""
    ended = Invitation.objects.filter(pk=invitation.pk, revoked_at=None).update(revoked_at=timezone.now())
    if ended:
        parameters = {"course": invitation.course.slug, "invitation": str(invitation.pk)}
        record("course.uninvite", actor=actor, parameters=parameters)


def invitation_of(code: str) -> Invitation | None:
    """Return the invitation with this code; None if there is none."""
    return Invitation.objects.select_related("course").filter(code=code.lower().replace("\0", "")).first()


def check_invitation(invitation: Invitation | None, now: datetime) -> Refusal | None:
    """Return why nobody can join by this invitation; None if people can join."""
    if invitation is None:
        text = say("This invitation does not exist. Ask your teacher for a new one.")
        return Refusal("no_invitation", text, "account")
    if invitation.revoked_at is not None:
        text = say("This invitation was revoked. Ask your teacher for a new one.")
        return Refusal("invitation_revoked", text, "account")
    if now >= invitation.expires_at:
        text = say("This invitation has expired. Ask your teacher for a new one.")
        return Refusal("invitation_expired", text, "account")
    if invitation.uses >= invitation.most_uses:
        text = say(
            "As many people have joined as this invitation is for: {people}. Ask your teacher for a new one.",
            people=invitation.most_uses,
        )
        return Refusal("invitation_used", text, "account", {"people": invitation.most_uses})
    if invitation.course.archived or invitation.course.ends_on < lab_date(now):
        return Refusal("course_over", "This course is over.", "account")
    return None


@transaction.atomic
def invitation_accept(*, invitation: Invitation, person: User, now: datetime) -> bool:
    """Enrol `person`. Returns False if the person was enrolled already. Raises `EnrolmentRefused`."""
    locked = Invitation.objects.select_for_update(of=("self",)).select_related("course").get(pk=invitation.pk)
    if Enrolment.objects.filter(course=locked.course, person=person).exists():
        return False
    if (refusal := check_invitation(locked, now)) is not None:
        raise EnrolmentRefused(refusal)
    locked.uses += 1
    locked.save(update_fields=["uses"])
    enrol(course=locked.course, people=[person], actor=person, invitation=locked)
    return True


def _parts(whole: Sequence[T], size: int) -> Iterable[Sequence[T]]:
    return (whole[start : start + size] for start in range(0, len(whole), size))
