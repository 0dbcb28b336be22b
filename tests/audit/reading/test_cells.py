"""No cell of an exported file is a formula."""

import pytest

from fleet.audit.reading.exports import safe_cell

FORMULAS = [
    "=1+1",
    "+1",
    "-1",
    "@SUM(A1)",
    "\t=1",
    "\r=1",
    "\n=1",
    "\uff1d1",
    "\uff0b1",
    "\uff0d1",
    "\uff201",
]


@pytest.mark.parametrize("text", FORMULAS)
def test_no_cell_begins_as_a_formula(text):
    assert safe_cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["hello", "1-1", "a=b", "'quoted", "", "مرحبا"])
def test_other_cells_are_as_they_are(text):
    assert safe_cell(text) == text
