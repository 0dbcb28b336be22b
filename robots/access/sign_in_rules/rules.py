"""Applies the rules at each single sign-on, and changes them.

A rule adds and removes only what a rule added: a person whom somebody enrolled by hand stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from allauth.account.signals import user_logged_in
from allauth.socialaccount.models import SocialAccount
from django.db import transaction
from django.dispatch import receiver

from fleet.accounts.models import User
from fleet.audit.services import record
from robots.access.enrolment import enrol, unenrol
from robots.access.models import Enrolment, GroupRole, SignInRule
from robots.access.services import group_role_set
from robots.access.sign_in_rules.claims import values_of
from robots.registry.models import Role


@receiver(user_logged_in)
def _signed_in(*, user: User, sociallogin: Any = None, **_options: Any) -> None:
    if sociallogin is not None:
        apply(user, claims_in(sociallogin.account))


def claims_in(account: SocialAccount) -> dict[str, Any]:
    """Return the claims of the last sign-in: those of the ID token, and those of the user info."""
    data = account.extra_data
    if "userinfo" in data or "id_token" in data:
        return {**(data.get("id_token") or {}), **(data.get("userinfo") or {})}
    return dict(data)


@transaction.atomic
def apply(person: User, claims: Mapping[str, Any]) -> None:
    """Give the person what the rules say, and take away what a rule gave and no rule gives any more."""
    rules = list(SignInRule.objects.select_related("course", "group"))
    fitting = [rule for rule in rules if rule.value in values_of(claims, rule.claim)]
    _courses(person, [rule for rule in fitting if rule.course is not None])
    _groups(person, [rule for rule in fitting if rule.group is not None])


def _courses(person: User, rules: list[SignInRule]) -> None:
    for rule in rules:
        course = rule.course
        if course is not None and enrol(course=course, people=[person], actor=None):
            Enrolment.objects.filter(course=course, person=person).update(by_rule=rule)
    given = Enrolment.objects.filter(person=person).exclude(by_rule=None).select_related("course")
    for lost in given.exclude(course__in=[rule.course for rule in rules]):
        unenrol(course=lost.course, people=[person], actor=None)


def _groups(person: User, rules: list[SignInRule]) -> None:
    wanted: dict[int, SignInRule] = {}
    for rule in sorted(rules, key=lambda one: Role(one.role).rank):
        wanted[rule.group_id or 0] = rule  # the highest role of several rules
    held = {one.group_id: one for one in GroupRole.objects.filter(user=person).select_related("group")}
    for key, rule in wanted.items():
        own = held.get(key)
        if own is not None and own.by_rule_id is None:
            continue  # somebody gave the person a role by hand
        if rule.group is not None and (own is None or own.role != rule.role):
            group_role_set(group=rule.group, user=person, role=Role(rule.role), actor=None)
        GroupRole.objects.filter(group=rule.group, user=person).update(by_rule=rule)
    for key, lost in held.items():
        if lost.by_rule_id is not None and key not in wanted:
            group_role_set(group=lost.group, user=person, role=None, actor=None)


@transaction.atomic
def rule_make(rule: SignInRule, actor: User) -> None:
    """Store a new rule. Raises `ValidationError`."""
    rule.full_clean()
    rule.save()
    record("rule.make", actor=actor, parameters=_facts(rule))


@transaction.atomic
def rule_remove(rule: SignInRule, actor: User) -> None:
    """Remove a rule. What it gave stays, as if somebody had given it by hand."""
    record("rule.remove", actor=actor, parameters=_facts(rule))
    rule.delete()


def _facts(rule: SignInRule) -> dict[str, str]:
    place = {"course": rule.course.slug} if rule.course else {"group": rule.group.slug if rule.group else ""}
    return {"claim": rule.claim, "value": rule.value, **place, "role": rule.role}
