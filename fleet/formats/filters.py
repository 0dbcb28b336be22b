"""Filters of templates."""

from __future__ import annotations

from django import template

from fleet.formats.sentences import words_of

register = template.Library()
register.filter("words", words_of)
