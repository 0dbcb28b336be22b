"""Names that people choose: which are refused, and which of real people are not."""

# ruff: noqa: RUF001  # letters that look like others are the subject

from __future__ import annotations

import pytest

from fleet.base.names import Looks, fault_of, fault_of_person, fault_of_word, folded

OF_PEOPLE = (
    "Ada Lovelace",
    "Äiti Öljynen",
    "Νίκος Παπαδόπουλος",
    "Иван Иванов-Петров",
    "محمد علی\u200cرضا",  # a joiner between Persian letters
    "ශ්\u200dරී",  # and after a virama
    "אברהם",
    "王小明",
    "山田ラーメン太郎",
    "李John",
    "Nguyễn Thị Hồng",
    "Jose\u0301",
    "O'Brien-Smith",
    "D’Angelo",
    "Hawaiʻi Kāne",
    "Łukasz Yıldız",
    "olga@example.org",
    "র\u200d্যাচেল",  # Bengali: a joiner before the virama
    "ರ\u200d್ಯಾಂಕ್",  # Kannada
    "လျှို့ဝှက်",  # Burmese: four marks on one letter
    "ᠨ\u180b\u180eᠠ",  # Mongolian: a variant and the separator of a vowel
)
TEXTS = ("Demo 👩\u200d🏫", "🧑🏽\u200d🚀 Mars", "❤\ufe0f\u200d🔥", "A ↔\ufe0f B", "1\ufe0f⃣ first", "⏱\ufe0f")
UNSEEN = (
    " ",
    "a\nb",
    "a\r",
    "a\tb",
    "a\u2028b",
    "a\x85b",
    "a\x00",
    "a\u202eb",  # right-to-left override
    "a\u2066b",
    "a\u200bb",  # zero width
    "a\u200db",
    "\ufeffa",
    "a\u00adb",  # soft hyphen
    "\u3164",  # Hangul filler
    "\u2800",  # blank Braille
    "a\ufe0f",
    "1\ufe0f",
    "a\u180b",
    "\u180b",
    "ᠨ\u180b\u180b",
    "👩\u200da",
    "👩\u200d",
    "a\ue000",  # private use
    "\U000e0041",  # tag
    "a" + "\u0301" * 5,
)


@pytest.mark.parametrize("name", OF_PEOPLE)
def test_names_of_people_are_fine(name: str) -> None:
    assert fault_of_person(name) is None
    assert fault_of_word(name) is None


@pytest.mark.parametrize("text", TEXTS)
def test_texts_may_have_signs_of_several_characters(text: str) -> None:
    assert fault_of(text) is None


@pytest.mark.parametrize("name", UNSEEN)
def test_what_nobody_sees_is_refused(name: str) -> None:
    fault = fault_of(name)
    assert fault is not None
    assert fault.code == "name_unseen"


@pytest.mark.parametrize("name", ["Zоra", "pаypal", "Νick", "olgа@example.org"])
def test_two_scripts_in_one_word_are_refused(name: str) -> None:
    fault = fault_of_person(name)
    assert fault is not None
    assert fault.code == "name_mixed"


@pytest.mark.parametrize("name", ["me", "ME", "ｍｅ", "Console", "none", "mе", "all"])
def test_words_of_addresses_are_refused(name: str) -> None:
    assert fault_of_word(name) is not None
    assert fault_of_word(f"{name}ry") is None


def test_names_that_look_the_same_are_found() -> None:
    looks = Looks(["Olga Operator", "olga", "Cepa", "Lan"])
    for name in ("Оlgа Operator", "OIga Operator", "0lga Operator", "оlgа", "Сера"):
        assert looks.alike(name), name
    for name in ("Olga Operator", "OLGA", "Olga Opera", "Ian", "Νίκος"):
        assert not looks.alike(name), name
    assert folded("ＯＬＧＡ  operator ") == folded("Olga Operator")


@pytest.mark.parametrize(("one", "other"), [("Хулан", "Хүлан"), ("Σία", "Οία"), ("Хулан Olga", "Хүлан Olga")])
def test_letters_of_one_script_tell_names_apart(one: str, other: str) -> None:
    assert not Looks([one]).alike(other)
    assert not Looks([other]).alike(one)


def test_each_word_is_compared_in_its_own_script() -> None:
    looks = Looks(["Cepa Хор", "Сера-Axe"])
    assert looks.alike("Сера Xop")
    assert looks.alike("Cepa-Ахе")
