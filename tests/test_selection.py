"""The list of long tests, and the order of a shuffled run."""

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

from tests.selection import NAMES, is_long, shuffle

REPOSITORY = Path(__file__).parent.parent


def test_every_name_of_the_list_is_there() -> None:
    """A renamed test would come back into every run in silence, or never run at all."""
    for name in NAMES:
        file, _, test = name.partition("::")
        files = list(REPOSITORY.glob(file.partition("[")[0]))
        assert files, name
        function = test.partition("[")[0]
        assert function in ("", "*") or f"def {function}(" in files[0].read_text(), name


def test_a_name_covers_its_cases_and_what_a_folder_holds() -> None:
    assert is_long("tests/browser/hands/long/test_patience.py::test_a[one / two]")
    assert not is_long("tests/browser/hands/test_held_input.py::test_a")
    assert is_long("tests/browser/test_pages.py::test_a[dark]")
    assert not is_long("tests/browser/test_pages.py::test_a[light]")
    assert is_long("tests/drives/test_bench_world.py::test_a")
    assert not is_long("tests/drives/test_bench_world_more.py::test_a")


def test_a_shuffled_run_keeps_files_together_and_comes_again() -> None:
    tests = [
        SimpleNamespace(
            path=Path(f"test_{file}.py"),
            number=number,
            get_closest_marker=lambda _, last=number == 4: last or None,
        )
        for file in "abc"
        for number in range(9)
    ]
    first, second = list(tests), list(tests)
    shuffle(first, 5)  # type: ignore[arg-type]
    shuffle(second, 5)  # type: ignore[arg-type]
    assert first == second != tests
    files = [test.path for test in first]
    assert sum(a != b for a, b in pairwise(files)) == 2
    assert [test.number for test in first[8::9]] == [4, 4, 4]  # each is the last of its file
