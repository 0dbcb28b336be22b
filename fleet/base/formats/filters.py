"""Filters and tags of templates."""

from typing import Any

from django import template
from django.template import defaultfilters

from fleet.base.formats.dates import in_language
from fleet.base.formats.sentences import in_words, words_of
from fleet.base.version import release

register = template.Library()
register.filter("words", words_of)
register.filter("in_words", in_words)
register.simple_tag(release, name="release")


@register.filter(expects_localtime=True, is_safe=False)
def date(value: Any, form: str | None = None) -> str:
    """Return a date as Django's filter does, and as the reader's language writes it."""
    return str(defaultfilters.date(value, form and in_language(form)))
