"""Phrases as a plain text file: one per line, `language<TAB>text`, or only the text if it is in the default language.

A third field may contain tags, separated by commas. The file is UTF-8; empty lines are ignored. A language is a BCP 47
code such as en-GB.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from msgspec import Struct

from fleet.base.names import fault_of
from robots.registry.configuration.profile_schema import LANGUAGE, Problems
from robots.shared.configuration.spoken_texts import why_not_speakable
from robots.shared.sentences import Sentence, say

LARGEST_FILE_BYTES = 1_000_000
MOST_PHRASES = 1000  # in one file
LONGEST_TAGS = 200  # characters, for one phrase
MOST_NAMED = 10  # bad lines, in one message
FALLBACK_LANGUAGE = "en-GB"


class Line(Struct, frozen=True):
    """One phrase."""

    text: str
    language: str
    tags: tuple[str, ...] = ()


def why_no_language(code: str) -> str | None:
    """Return why this is no language code; None if it has the form of a code."""
    if LANGUAGE.fullmatch(code):
        return None
    return say("“{code}” is not a language code such as en-GB.", code=code)


def why_no_phrase(text: str) -> str | None:
    """Return why this is no phrase; None if it is one."""
    if "\n" in text or "\t" in text:
        return say("A phrase is one line, without tabs.")
    if refusal := why_not_speakable(text):
        return refusal.sentence
    fault = fault_of(text)
    return str(fault.text) if fault else None


def why_no_tags(tags: Iterable[str]) -> str | None:
    """Return why these cannot be tags of a phrase; None if they can."""
    text = tags_text(tags)
    if fault := fault_of(text):
        return str(fault.text)
    if len(text) > LONGEST_TAGS:
        return say(
            "The tags have {count} characters; there is room for {most}.", count=len(text), most=LONGEST_TAGS
        )
    return None


def in_usual_case(code: str) -> str:
    """Return a language code with the usual capitals, as robots and browsers write it: EN-gb → en-GB."""
    first, *others = code.split("-")
    cased = [{2: str.upper, 4: str.title}.get(len(part), str.lower)(part) for part in others]
    return "-".join([first.lower(), *cased])


def tags_in(text: str) -> tuple[str, ...]:
    """Return the tags of a text that separates them by commas; each tag once."""
    spaced = (" ".join(tag.split()) for tag in text.split(","))
    return tuple(dict.fromkeys(tag for tag in spaced if tag))


def tags_text(tags: Iterable[str]) -> str:
    """Return tags as one text, as they are stored and written to a file."""
    return ", ".join(tags)


# --- files ---------------------------------------------------------------------------------------


def read(content: bytes, default_language: str = FALLBACK_LANGUAGE) -> list[Line]:
    """Return the phrases of a file, each once; raise `Problems` with the numbers of wrong lines."""
    phrases: dict[tuple[str, str], Line] = {}
    problems: list[str] = []
    for number, line in enumerate(_text(content).split("\n"), start=1):
        if not line.strip():
            continue
        found = _phrase(line, default_language)
        if isinstance(found, Line):
            phrases.setdefault((found.language, found.text), found)
        else:
            problems.append(in_line(number, found))
    if not phrases and not problems:
        problems.append(say("There is no phrase in the file."))
    if len(phrases) > MOST_PHRASES:
        problems.append(
            say(
                "There are {count} phrases; a file has at most {most}.", count=len(phrases), most=MOST_PHRASES
            )
        )
    if problems:
        raise Problems(shortened(problems))
    return list(phrases.values())


def read_file(path: Path, default_language: str = FALLBACK_LANGUAGE) -> list[Line]:
    """Return the phrases of the file with this path, see `read`."""
    with path.open("rb") as file:
        return read(file.read(LARGEST_FILE_BYTES + 1), default_language)


def file_text(phrases: Iterable[Line]) -> str:
    """Return these phrases as the content of a file, which `read` can read."""
    lines = ([phrase.language, phrase.text, tags_text(phrase.tags)] for phrase in phrases)
    return "".join("\t".join(filter(None, fields)) + "\n" for fields in lines)


def _text(content: bytes) -> str:
    if len(content) > LARGEST_FILE_BYTES:
        raise Problems([say("The file is larger than {most} kB.", most=LARGEST_FILE_BYTES // 1000)])
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        number = content[: error.start].count(b"\n") + 1
        raise Problems([in_line(number, say("This is not UTF-8 text. Save the file as UTF-8."))]) from error


def _phrase(line: str, default_language: str) -> Line | str:
    """Return the phrase of the line, or the line's fault."""
    fields = [field.strip() for field in line.split("\t")]
    if len(fields) > 3:
        return say("There are more than two tabs: a line is language, tab, text, and perhaps a tab and tags.")
    language, text = (default_language, fields[0]) if len(fields) == 1 else (fields[0], fields[1])
    tags = tags_in("".join(fields[2:]))
    if why := why_no_language(language) or why_no_phrase(text) or why_no_tags(tags):
        return why
    return Line(text, in_usual_case(language), tags)


def shortened(problems: Sequence[str]) -> Sequence[str]:
    """Return the first `MOST_NAMED` faults of a file, and how many more there are."""
    more = len(problems) - MOST_NAMED
    return [*problems[:MOST_NAMED], say("and {count} more.", count=more)] if more > 0 else problems


def in_line(number: int, problem: str) -> Sentence:
    """Return the fault of a line of a file."""
    return say("line {number}: {problem}", number=number, problem=problem)
