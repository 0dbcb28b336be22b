"""The preview of a list of people: each line and column as it was read, and as it will be stored."""

from __future__ import annotations

from typing import Any

from django.utils.translation import gettext as _
from msgspec import Struct

from robots.access.enrolment import Plan
from robots.access.pages.forms import ROLES, PeopleForm, digest
from robots.access.people_lists.columns import Column, Role
from robots.access.people_lists.reading import PeopleList


class Row(Struct, frozen=True):
    """A line of the list. `fault`: why it is left out; then `name`, `email` and `number` are empty."""

    line: int
    cells: list[str]
    name: str = ""
    email: str = ""
    number: str = ""
    effect: str = ""
    fault: str = ""


def preview(form: PeopleForm, plan: Plan) -> dict[str, Any]:
    """Return the templates' context for a form that has read a list, and the list's plan."""
    people = form.people_list
    return {
        "plan": plan,
        "seen": digest(people),
        "rows": _rows(people, plan),
        "columns": [_with_choices(column) for column in people.columns],
        "separator": people.separator,
        "numbered": any(column.role is Role.NUMBER for column in people.columns),
        "encoding_fault": form.encoding_fault,
        "guessed": form.decoded if form.decoded and not form.decoded.certain else None,
    }


def _with_choices(column: Column) -> dict[str, Any]:
    return {
        "title": column.title,
        "role": column.role.value,
        "choices": ROLES,
        "used": column.role is not Role.UNUSED,
    }


def _rows(people: PeopleList, plan: Plan) -> list[Row]:
    width = len(people.columns)
    effects = {one.key: _("new account") for one in plan.new}
    stored = {account.pk: account for account in (*plan.known, *plan.enrolled)}
    by_number = {plan.numbers[key]: account for key, account in stored.items() if key in plan.numbers}
    by_address = {account.email: account for account in stored.values() if account.email}
    inside, renumbered = ({one.pk for one in part} for part in (plan.enrolled, plan.renumbered))
    faults = {wrong.line: wrong.reason for wrong in plan.wrong}
    rows = [
        Row(each.line, _cells(each, width), fault=each.reason)
        for each in (*people.wrong, *people.repeated, *people.titles)
    ]
    for one in people.people:
        if one.line in faults:
            rows.append(Row(one.line, _cells(one, width), fault=faults[one.line]))
            continue
        account = by_address.get(one.email) or by_number.get(one.number)
        name, email = (account.display_name, account.email) if account else (one.name, one.email)
        effect = effects.get(one.key, "")
        if one.key in plan.namesakes:
            effect = _("new; somebody of this name is in the course: the same person?")
        if account:
            effect = _("in the course already") if account.pk in inside else _("has an account")
            if account.pk in renumbered:
                effect = _("in the course already; the number is stored")
        rows.append(Row(one.line, _cells(one, width), name, email, one.number, effect))
    return sorted(rows, key=lambda row: row.line)


def _cells(each: Any, width: int) -> list[str]:
    return [*each.cells, *[""] * (width - len(each.cells))]
