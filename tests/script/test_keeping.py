"""script/serve keeps its processes running, each for itself."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from robots.shared.processes.shutdown import EXIT_ALREADY_RUNNING
from script.stack.places import REPOSITORY
from script.stack.serve import arguments
from tests.processes import until
from tests.script.support import ENDED_S, Family

SLEEP = "import time; time.sleep(60)"
KEEPING = """
import sys
from script.service.keeping import Kept, keep
from script.stack.processes import ChildDied, Ended, ended_by_signals
ready, *programs = sys.argv[1:]
try:
    with ended_by_signals():
        kept = [Kept(f"p{n}", [sys.executable, "-c", program]) for n, program in enumerate(programs)]
        keep(kept, lambda: ready == "ready", lambda: print("introduced", flush=True))
except ChildDied as died:
    sys.exit(str(died))
except Ended:
    pass
"""


def keeping(*words: str, log: Path) -> subprocess.Popen[bytes]:
    with log.open("wb") as output:
        return subprocess.Popen(
            [sys.executable, "-c", KEEPING, *words], cwd=REPOSITORY, stdout=output, stderr=output
        )


def test_a_process_that_dies_comes_back_and_the_other_stays(tmp_path: Path) -> None:
    log = tmp_path / "log"
    console = keeping("ready", SLEEP, "raise SystemExit(7)", log=log)
    try:
        until(lambda: log.read_text().count("started again in") >= 2, "two starts again", ENDED_S)
        assert "introduced\np1 ended with status 7; it is started again in 0.5 s." in log.read_text()
        family = Family(console.pid)
        assert len(family) >= 2  # the first process runs on
        console.send_signal(signal.SIGTERM)
        assert console.wait(ENDED_S) == 0
        family.assert_gone()
    finally:
        console.kill()


REFUSED = f"raise SystemExit({EXIT_ALREADY_RUNNING})"


@pytest.mark.parametrize(
    ("ready", "programs"), [("never", [SLEEP, "raise SystemExit(7)"]), ("ready", [REFUSED])]
)
def test_a_process_that_cannot_do_its_work_ends_all(ready: str, programs: list[str], tmp_path: Path) -> None:
    log = tmp_path / "log"
    assert keeping(ready, *programs, log=log).wait(ENDED_S) == 1
    assert re.search(r"^p\d ended with status [37]\.$", log.read_text(), re.MULTILINE)


def test_pages_go_on_while_another_supervisor_does_the_work(tmp_path: Path) -> None:
    log = tmp_path / "log"
    console = keeping("ready", SLEEP, REFUSED, log=log)
    try:
        until(
            lambda: "p1 ended with status 3; it is started again in 60 s." in log.read_text(),
            "it waits",
            ENDED_S,
        )
        assert len(Family(console.pid)) >= 2
    finally:
        console.send_signal(signal.SIGTERM)
        assert console.wait(ENDED_S) == 0


def test_a_bridge_host_takes_no_words_of_a_web_process(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        arguments(["bridges", "--port", "443"])
    assert "the role bridges takes no options" in capsys.readouterr().err
    assert arguments(["bridges"]).role == "bridges"
