"""script/install-service bridges --join: what is there stays. tests/script/installed joins a real console."""

from __future__ import annotations

from pathlib import Path

import pytest

from script.service import join, manage


@pytest.mark.parametrize("name", ["fleet.env", "fleet.crt", "fleet.key", "fleet-authority.crt"])
def test_no_file_is_overwritten_and_the_code_is_kept(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / name).write_text("of browsers")
    monkeypatch.setattr(join, "ask", lambda *_: pytest.fail("the code was used"))
    with pytest.raises(join.NotJoined, match=f"{name}: there already"):
        join.join("https://fleet.lab.example/", "code", tmp_path / "fleet.env", tmp_path.owner())
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_settings_have_quotes_only_if_they_need_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Containers take quotes literally (--env-file)."""
    url = "postgresql://fleet:p%40ss@db.lab.example/fleet?sslmode=require"
    settings = {
        "FLEET_BRIDGE_HOST": "arm.lab.example",
        "FLEET_DATABASE_URL": url,
        "FLEET_LINK_SECRET": "a 'secret'",
    }
    answer = {"settings": settings, "certificate": "", "authority": ""}
    monkeypatch.setattr(join, "ask", lambda *_: answer)
    env = tmp_path / "fleet.env"
    join.join("https://fleet.lab.example/", "code", env, tmp_path.owner())
    assert f"\nFLEET_DATABASE_URL={url}\n" in env.read_text()
    assert dict(manage.variables(env.read_text())).items() >= settings.items()
