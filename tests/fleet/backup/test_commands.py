"""`manage.py backup` and `manage.py restore`, on SQLite. tests/script/test_backup.py has PostgreSQL."""

from __future__ import annotations

import io
import resource
import shutil
import sqlite3
import tarfile
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec
import pytest
from django.core.management import call_command
from django.core.management.base import CommandError
from django.db import connection
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from fleet.backup import contents
from fleet.backup.archive import tar
from fleet.backup.checking import Checked
from fleet.backup.selectors import last_backup
from fleet.backup.workplace import workplace
from robots.shared.processes.one_supervisor import LOCK, only_instance
from tests.audit.support import tamper
from tests.fleet.backup.support import listening, new_console, using

PASSPHRASE = "correct horse battery staple"


def run(command: str, *words: Any, **options: Any) -> str:
    out = io.StringIO()
    call_command(command, *map(str, words), stdout=out, stderr=out, **options)
    return out.getvalue()


def backup(target: Path, *words: Any) -> Path:
    return Path(run("backup", target, *words).split(": ")[0])


@pytest.fixture
def passphrase(tmp_path: Path) -> list[str]:
    file = tmp_path / "passphrase"
    file.write_text(f"{PASSPHRASE}\n")
    return ["--passphrase-file", str(file)]


def test_a_backup_comes_back_on_a_new_computer(console: Path, tmp_path: Path, settings: Any) -> None:
    archive = backup(tmp_path, "--verify")
    assert archive.stat().st_mode & 0o777 == 0o600
    known = last_backup()
    assert (known.archive, known.size) == (archive.name, archive.stat().st_size)
    assert known.at and known.checked_at and not known.failed_at
    with new_console(tmp_path / "new", settings):
        words = run("restore", archive)
        assert "all are as written" in words
        assert User.objects.get().username == "ada"
        assert Record.objects.latest("pk").kind == "backup.restore"
        run("verify_audit")
    assert not list(console.glob("backup-work/*"))


def test_a_computer_without_a_database_gets_one(console: Path, tmp_path: Path) -> None:
    archive = backup(tmp_path)
    (console / "fleet.sqlite3").rename(tmp_path / "gone")
    run("restore", archive)
    assert User.objects.get().username == "ada"


def test_people_are_replaced_only_when_asked_and_kept_beside(console: Path, tmp_path: Path) -> None:
    archive = backup(tmp_path / "one.tar.gz")
    User.objects.create_user("later")
    with pytest.raises(CommandError, match="accounts: 2"):
        run("restore", archive)
    words = run("restore", archive, "--replace")
    assert [person.username for person in User.objects.all()] == ["ada"]
    (kept,) = console.glob("fleet.sqlite3.before-*")
    assert str(kept) in words


@pytest.mark.parametrize("runs", ["supervisor", "web process", "somebody at the database"])
def test_nothing_is_restored_while_the_console_runs(console: Path, tmp_path: Path, runs: str) -> None:
    archive = backup(tmp_path)
    before = (console / "fleet.sqlite3").stat().st_ino
    busy = {
        "supervisor": only_instance(console / "run" / LOCK),
        "web process": listening(console / "run/web-1.sock"),
        "somebody at the database": using(console / "fleet.sqlite3"),
    }
    with busy[runs], pytest.raises(CommandError, match="The console runs"):
        run("restore", archive, "--replace")
    assert (console / "fleet.sqlite3").stat().st_ino == before
    connection.close()
    assert "Restored" in run("restore", archive, "--replace")


def test_a_process_that_starts_meanwhile_keeps_its_database(console: Path, tmp_path: Path) -> None:
    archive = backup(tmp_path)
    before = (console / "fleet.sqlite3").stat().st_ino
    with ExitStack() as started:

        def verified(*_: Any) -> Checked:
            started.enter_context(using(console / "fleet.sqlite3"))
            return Checked(contents.manifest("sqlite", timezone.now()), 0, 0, [])

        with (
            mock.patch("fleet.backup.restoring.verified", verified),
            pytest.raises(CommandError, match="meanwhile"),
        ):
            run("restore", archive, "--replace")
    assert (console / "fleet.sqlite3").stat().st_ino == before
    assert not list(console.glob("*before*"))


def test_the_database_of_something_else_is_not_replaced(console: Path, tmp_path: Path) -> None:
    archive = backup(tmp_path)
    (console / "fleet.sqlite3").rename(tmp_path / "gone")
    with closing(sqlite3.connect(console / "fleet.sqlite3")) as other:
        other.execute("CREATE TABLE grades (student TEXT)")
    with pytest.raises(CommandError, match="something else, such as grades"):
        run("restore", archive)


def test_a_file_that_may_not_be_read_is_refused_in_words(console: Path, tmp_path: Path) -> None:
    with (
        mock.patch.object(Path, "is_file", side_effect=PermissionError(13, "Permission denied", "/closed/x")),
        pytest.raises(CommandError, match="Permission denied: '/closed/x'"),
    ):
        run("restore", tmp_path / "x")


def test_a_passphrase_encrypts_and_a_wrong_one_opens_nothing(
    console: Path, tmp_path: Path, passphrase: list[str]
) -> None:
    archive = backup(tmp_path, *passphrase)
    assert archive.name.endswith(".tar.gz.age")
    assert "all are as written" in run("backup", "--check", archive, *passphrase)
    (tmp_path / "passphrase").write_text("another")
    for command in (["restore", archive, "--replace"], ["backup", "--check", archive]):
        with pytest.raises(CommandError, match="passphrase is wrong"):
            run(*command, *passphrase)
    assert last_backup().checked_at
    assert Record.objects.latest("pk").outcome == "failed"


@pytest.mark.parametrize("encrypted", [False, True])
def test_a_cut_or_changed_archive_is_refused(
    console: Path, tmp_path: Path, passphrase: list[str], encrypted: bool
) -> None:
    words = passphrase if encrypted else []
    whole = backup(tmp_path, *words).read_bytes()
    middle = len(whole) // 2
    damaged = [whole[:-1], whole[:-40], whole[:middle], whole[:20], b""]
    if encrypted:  # without: a changed byte may stand for the same bytes, and else a digest differs (below)
        damaged.append(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    for bytes_ in damaged:
        (tmp_path / "damaged").write_bytes(bytes_)
        with pytest.raises(CommandError, match="damaged"):
            run("restore", tmp_path / "damaged", "--replace", *words)
    assert User.objects.count() == 1


@pytest.mark.parametrize("change", ["one has other bytes", "one is missing", "one was added"])
def test_each_file_of_an_archive_must_have_its_digest(console: Path, tmp_path: Path, change: str) -> None:
    names = ["manifest.json", "heads.jsonl", "database.sqlite3", "SHA256SUMS"]
    with tarfile.open(backup(tmp_path)) as whole:
        files = {name: whole.extractfile(name).read() for name in names}
    match change:
        case "one has other bytes":
            files["heads.jsonl"] += b"\n"
        case "one is missing":
            del files["heads.jsonl"]
        case _:
            files = {"manifest.json": files["manifest.json"], "more": b"", **files}
    with tarfile.open(tmp_path / "changed.tar.gz", "w:gz") as changed:
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            changed.addfile(entry, io.BytesIO(content))
    with pytest.raises(CommandError, match="another digest"):
        run("backup", "--check", tmp_path / "changed.tar.gz")


def test_a_full_disk_leaves_no_half_archive_and_the_older_ones(console: Path, tmp_path: Path) -> None:
    folder = tmp_path / "backups"
    folder.mkdir()
    first = backup(folder)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for most in (2_000, 1_000_000):  # the archive, or the copy of the database
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
        try:
            with pytest.raises(CommandError):
                run("backup", folder, "--keep", "1")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(folder.iterdir()) == [first]
    assert not list(console.glob("backup-work/*"))


def test_a_newer_release_is_named_and_nothing_is_changed(
    console: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = contents.manifest

    def newer(*about: Any) -> tar.Manifest:
        made = ours(*about)
        return msgspec.structs.replace(
            made, version="9.1.0", migrations=[*made.migrations, "teleop.0999_wings"]
        )

    monkeypatch.setattr("fleet.backup.services.manifest", newer)
    archive = backup(tmp_path)
    with pytest.raises(CommandError, match=r"Install 9\.1\.0"):
        run("restore", archive, "--replace")
    assert User.objects.count() == 1


def test_an_older_database_is_restored_and_asks_for_migrations(console: Path, tmp_path: Path) -> None:
    with connection.cursor() as cursor:
        cursor.execute("DELETE FROM django_migrations WHERE app = 'teleop'")
    assert "manage.py upgrade" in run("restore", backup(tmp_path), "--replace")


def test_a_changed_log_is_found_and_restored_only_when_asked(console: Path, tmp_path: Path) -> None:
    tamper("UPDATE audit_content SET text = 'Bye.'")
    archive = backup(tmp_path)
    with pytest.raises(CommandError, match="not as it was written"):
        run("backup", "--check", archive)
    with pytest.raises(CommandError, match="--despite-findings"):
        run("restore", archive, "--replace")
    assert "another content" in run("restore", archive, "--replace", "--despite-findings")


def test_the_log_must_reach_the_heads_of_the_archive(
    console: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    later = contents.log_heads()
    with monkeypatch.context() as patch:
        patch.setattr("fleet.backup.services.log_heads", lambda: later)
        tamper("DELETE FROM audit_content")
        tamper("DELETE FROM audit_record WHERE robot_id IS NOT NULL")
        archive = backup(tmp_path)
    with pytest.raises(CommandError, match="not as it was written"):
        run("backup", "--check", archive)


def test_settings_and_meshes_come_if_asked_and_are_put_beside(
    console: Path, tmp_path: Path, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "ros/tiago_description"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package/>")
    (package / "head.STL").write_bytes(b"mesh")
    (package / "movie.mp4").write_bytes(b"long")
    settings.FLEET_MESHES = [tmp_path / "ros"]
    monkeypatch.setenv("FLEET_HOSTS", "it's here")
    monkeypatch.setenv("FLEET_BACKUP_PASSPHRASE", PASSPHRASE)
    archive = backup(tmp_path, "--with-settings", "--with-meshes")
    settings.SECRET_KEY = "another key, of a new computer, with thirty-two characters"
    assert "FLEET_SECRET_KEY" in run("restore", archive, "--replace")
    (beside,) = console.glob("restored-*")
    text = (beside / "settings/fleet.env").read_text()
    assert "FLEET_SECRET_KEY='a key for tests" in text
    assert PASSPHRASE not in text
    meshes = sorted(path.name for path in (beside / "meshes").rglob("*") if path.is_file())
    assert meshes == ["head.STL", "package.xml"]


def test_only_the_newest_archives_of_this_console_stay(
    console: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "backups"
    folder.mkdir()
    mark = f"fleet-{contents.host()}-{contents.console_mark()}"
    old = [folder / f"{mark}-2026-11-0{day}T031500Z.tar.gz{end}" for day, end in ((1, ""), (2, ".age"))]
    with monkeypatch.context() as patch:  # another console, in a container of the same name
        patch.setitem(connection.settings_dict, "HOST", "another")
        another = f"fleet-{contents.host()}-{contents.console_mark()}-2026-11-01T031500Z.tar.gz"
    others = [folder / another, folder / f"{another}.part", folder / "notes.txt"]
    left = folder / f"{old[0].name}.part"
    for path in (*old, *others, left):
        path.touch()
    new = backup(folder, "--keep", "2")
    assert set(folder.iterdir()) == {new, old[1], *others}


@pytest.mark.parametrize("links", [True, False])
def test_a_power_cut_in_the_exchange_leaves_the_console_its_database(
    console: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool
) -> None:
    archive = backup(tmp_path)
    User.objects.create_user("later")
    with monkeypatch.context() as cut:
        cut.setattr(Path, "replace", mock.Mock(side_effect=OSError("power")))
        cut.setattr("fleet.backup.sqlite.copy_database", shutil.copy)
        if not links:
            cut.setattr(Path, "hardlink_to", mock.Mock(side_effect=OSError("no links")))
        with pytest.raises(CommandError, match="power"):
            run("restore", archive, "--replace")
    assert User.objects.count() == 2


def test_two_at_once_do_not_share_a_folder(console: Path, tmp_path: Path) -> None:
    with workplace(console), pytest.raises(CommandError, match="Another backup"):
        run("backup", tmp_path)


def test_an_entry_does_not_lead_out_of_the_archive(console: Path, tmp_path: Path) -> None:
    about = contents.manifest("sqlite", timezone.now())
    with (tmp_path / "evil").open("wb") as file:
        tar.write(file, about, [tar.Entry("../outside", b"x")], None)
    with pytest.raises(CommandError, match="leads out"):
        run("backup", "--check", tmp_path / "evil")
    assert not list(tmp_path.rglob("outside"))


def test_a_folder_that_is_missing_becomes_no_file(
    console: Path, tmp_path: Path, passphrase: list[str]
) -> None:
    for words in (
        [tmp_path / "bakcups"],
        [tmp_path / "one.tar.gz", *passphrase],
        [tmp_path / "none/one.tar.gz"],
    ):
        with pytest.raises(CommandError, match=r"no folder|No such file"):
            run("backup", *words)
        assert last_backup().failed_at
    assert sorted(path.name for path in tmp_path.iterdir()) == ["passphrase", "var"]
