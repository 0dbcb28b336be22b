"""Layouts of the control page at a desk: which pictures are side by side, and whether the lists are shown."""

from __future__ import annotations

from django.core.exceptions import ValidationError
from django.utils.translation import gettext as _

CONTENTS = ("camera", "plan", "map", "scene", "second", "plot")
MOST_CELLS = 4


def check_cells(cells: list[str]) -> None:
    """Raise `ValidationError` if a cell has no content that a page knows, or if two cells have the same."""
    if len(cells) > MOST_CELLS or len(set(cells)) < len(cells) or not set(cells) <= set(CONTENTS):
        raise ValidationError(_("A layout has at most four different pictures."))
