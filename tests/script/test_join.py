"""script/install-service bridges --join: what is there stays. tests/script/installed joins a real console."""

from __future__ import annotations

from pathlib import Path

import pytest

from script.service import join


@pytest.mark.parametrize("name", ["fleet.env", "fleet.crt", "fleet.key", "fleet-authority.crt"])
def test_no_file_is_overwritten_and_the_code_is_kept(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).write_text("of browsers")
    monkeypatch.setattr(join, "ask", lambda *_: pytest.fail("the code was used"))
    with pytest.raises(join.NotJoined, match=f"{name}: there already"):
        join.join("https://fleet.lab.example/", "code", tmp_path / "fleet.env", tmp_path.owner())
    assert [path.name for path in tmp_path.iterdir()] == [name]
