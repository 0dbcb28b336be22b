"""Links between pages of the documentation have a target; a page for a task is short."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).parents[3]
PAGES = [*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")]
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")
LONGER = re.compile(r"# .+\n\n\*(Reference|Explanation)\.\*")  # such a page says so in its head
MOST_WORDS = 1500
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


@cache
def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub makes of a page's headings."""
    found = HEADING.findall(page.read_text())
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}


def test_links_lead_to_pages_and_headings() -> None:
    for page in PAGES:
        for target, anchor in LINK.findall(page.read_text()):
            file = (page.parent / target) if target else page
            assert file.exists(), f"{page}: {target} is missing"
            if anchor and file.suffix == ".md":
                assert anchor in anchors(file), f"{page}: {target}#{anchor} is missing"


def test_a_page_for_a_task_is_short() -> None:
    texts = {page: page.read_text() for page in (REPOSITORY / "docs").rglob("*.md")}
    words = {
        page: len(re.findall(r"\S*\w\S*", text)) for page, text in texts.items() if not LONGER.match(text)
    }
    assert {page: count for page, count in words.items() if count > MOST_WORDS} == {}


def test_the_spanish_list_marks_the_pages_that_are_in_english_only() -> None:
    folder = REPOSITORY / "docs" / "es"
    links = re.findall(r"\[([^]]+)\]\(([^)#]+)", (folder / "README.md").read_text())
    assert links
    for words, target in links:
        assert words.endswith(r"\*") == target.startswith("../"), target
        assert not (folder / Path(target).name).exists() or "/" not in target or "README" in target, target
