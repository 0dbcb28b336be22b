"""Filters of templates."""

from django import template

from fleet.base.formats.sentences import words_of

register = template.Library()
register.filter("words", words_of)
