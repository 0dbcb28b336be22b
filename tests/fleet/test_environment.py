"""A missing or wrong environment variable stops the start with an error that names it."""

import os
import runpy
import subprocess
import sys
from unittest import mock

import pytest
from django.core.exceptions import ImproperlyConfigured

from fleet.base import environment
from fleet.base.environment import Environment
from tests.processes import REPOSITORY

KEY = "k" * 50
SOUND = {"FLEET_SECRET_KEY": KEY, "FLEET_HOSTS": "fleet.example"}


def _start(tmp_path, **variables):
    """Run the real settings with this environment; return None or the words of their error."""
    try:
        with mock.patch.dict(os.environ, {"FLEET_VAR": str(tmp_path / "var"), **variables}, clear=True):
            runpy.run_path(str(REPOSITORY / "fleet/settings.py"))
    except ImproperlyConfigured as wrong:
        return str(wrong)
    return None


def test_a_key_and_hosts_are_enough(tmp_path):
    assert _start(tmp_path, **SOUND) is None
    assert (tmp_path / "var").stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "var/run").stat().st_mode & 0o777 == 0o700


def test_nothing_that_is_written_can_be_read_by_other_accounts(tmp_path):
    environ = {"PATH": os.environ["PATH"], "FLEET_VAR": str(tmp_path / "var"), **SOUND}
    write = "from fleet import settings; (settings.FLEET_VAR / 'any').touch()"
    subprocess.run([sys.executable, "-c", write], env=environ, cwd=REPOSITORY, check=True, umask=0o022)
    assert (tmp_path / "var/any").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("variable", ["FLEET_VAR", "FLEET_RUN_DIR"])
@pytest.mark.parametrize("mode", [0o750, 0o705])
def test_an_open_named_directory_is_refused_unchanged(variable, mode, tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    trouble = _start(tmp_path, **{**SOUND, variable: str(shared)})
    assert variable in trouble and f"chmod 700 {shared}" in trouble
    assert shared.stat().st_mode & 0o777 == mode


def test_an_own_open_directory_is_closed_to_others(tmp_path):
    (tmp_path / "var/run").mkdir(parents=True)
    (tmp_path / "var").chmod(0o700)
    (tmp_path / "var/run").chmod(0o755)
    assert _start(tmp_path, **SOUND) is None
    assert (tmp_path / "var/run").stat().st_mode & 0o777 == 0o700


def test_debug_needs_neither(tmp_path):
    assert _start(tmp_path, FLEET_DEBUG="1") is None


@pytest.mark.parametrize("missing", sorted(SOUND))
def test_production_does_not_start_without(missing, tmp_path):
    trouble = _start(tmp_path, **{name: value for name, value in SOUND.items() if name != missing})
    assert missing in trouble


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("FLEET_SECRET_KEY", "short"),
        ("FLEET_HOSTS", "*"),
        ("FLEET_HOSTS", "fleet.example,*.example"),
        ("FLEET_DEBUG", "perhaps"),
        ("FLEET_TLS", "2"),
        ("FLEET_ORIGINS", "fleet.example"),
        ("FLEET_ORIGINS", "https://fleet.example/path"),
        ("FLEET_ORIGINS", "ftp://fleet.example"),
        ("FLEET_VAR", "/dev/null/var"),
        ("FLEET_RUN_DIR", "/dev/null/run"),
        ("FLEET_DATABASE_URL", "mysql://root@localhost/fleet"),
        ("FLEET_DATABASE_URL", "postgresql://localhost"),
        ("FLEET_DATABASE_URL", "postgresql://localhost:many/fleet"),
        ("FLEET_REDIS_URL", "cache.lab.example"),
        ("FLEET_S3_URL", "minio.lab.example/bucket"),
        ("FLEET_S3_URL", "https://minio.lab.example"),
        ("FLEET_S3_URL", "https://key:secret@minio.lab.example/bucket"),
        ("FLEET_S3_URL", "https://minio.lab.example/bucket/../other bucket"),
        ("FLEET_LINK_SECRET", "short"),
        ("FLEET_LINK_CA", "/nowhere/ca.pem"),
        ("FLEET_CONTROL_TERM_S", "long"),
        ("FLEET_CONTROL_TERM_S", "nan"),
        ("FLEET_CONTROL_TERM_S", "1"),
    ],
)
def test_a_wrong_value_is_named(variable, value, tmp_path):
    trouble = _start(tmp_path, **{**SOUND, variable: value})
    assert variable in trouble


def test_a_tls_link_needs_its_secret():
    with pytest.raises(ImproperlyConfigured, match="FLEET_LINK_SECRET"):
        environment.link_secret(Environment({"FLEET_LINK_CA": "ca.pem"}))


def test_certificate_and_key_go_together():
    with pytest.raises(ImproperlyConfigured, match="FLEET_LINK_KEY"):
        environment.link_secret(Environment({"FLEET_LINK_SECRET": KEY, "FLEET_LINK_CERT": "cert.pem"}))


def test_a_postgresql_url_is_read_whole():
    entry = environment.database("postgresql://fl%40eet:p%2Fw@db.example:5433/fleet?sslmode=require")
    assert entry["ENGINE"] == "django.db.backends.postgresql"
    assert [entry[part] for part in ("USER", "PASSWORD", "HOST", "PORT", "NAME")] == [
        "fl@eet",
        "p/w",
        "db.example",
        "5433",
        "fleet",
    ]
    assert entry["OPTIONS"]["sslmode"] == "require"


def test_a_web_processes_query_limit_can_be_set_by_the_url():
    plain, own = (
        environment.database(f"postgresql://db.example/fleet{query}")
        for query in ("", "?options=-c%20statement_timeout%3D5min")
    )
    for entry in (plain, own):
        environment.limit_queries(entry)
    assert plain["OPTIONS"]["options"] == "-c statement_timeout=30s -c lock_timeout=5s"
    # The last value is valid
    assert own["OPTIONS"]["options"] == "-c statement_timeout=30s -c statement_timeout=5min"
    file = environment.database("sqlite:////var/lib/fleet/fleet.sqlite3")
    environment.limit_queries(file)
    assert file == environment.database("sqlite:////var/lib/fleet/fleet.sqlite3")


def test_a_sqlite_url_with_four_slashes_is_an_absolute_path():
    entry = environment.database("sqlite:////var/lib/fleet/fleet.sqlite3")
    assert entry["NAME"] == "/var/lib/fleet/fleet.sqlite3"
    assert "journal_mode=WAL" in entry["OPTIONS"]["init_command"]
    assert entry["OPTIONS"]["transaction_mode"] == "IMMEDIATE"


def test_lichtblick_is_served_from_a_build_only(tmp_path):
    folder = tmp_path / "web"
    wrong = _start(tmp_path, **SOUND, FLEET_LICHTBLICK=str(folder))
    assert f"{folder} is no build of Lichtblick" in wrong
    folder.mkdir()
    (folder / "index.html").write_text("<script src=main.js></script>")
    assert "is no build of Lichtblick" in _start(tmp_path, **SOUND, FLEET_LICHTBLICK=str(folder))
    (folder / "main.js").touch()
    assert _start(tmp_path, **SOUND, FLEET_LICHTBLICK=str(folder)) is None


S3 = {"FLEET_S3_URL": "https://s3.lab.example:9000/bucket/lab/one/", "FLEET_S3_KEY": "key"}


def test_an_object_store_has_its_secret_from_the_variable_or_a_file(tmp_path):
    (tmp_path / "secret").write_text("s3cret\n")
    in_file = {**S3, "FLEET_S3_SECRET_FILE": str(tmp_path / "secret")}
    store = environment.object_store(Environment(in_file))
    assert store == environment.object_store(Environment({**S3, "FLEET_S3_SECRET": "s3cret"}))
    assert (store.endpoint, store.bucket, store.prefix) == (
        "https://s3.lab.example:9000",
        "bucket",
        "lab/one/",
    )
    assert store.secret == "s3cret" and "s3cret" not in repr(store)
    assert environment.object_store(Environment({})) is None
    for wrong in (S3, {**in_file, "FLEET_S3_SECRET": "x"}, {**S3, "FLEET_S3_SECRET_FILE": "/dev/null"}):
        with pytest.raises(ImproperlyConfigured, match=r"^FLEET_S3_SECRET"):
            environment.object_store(Environment(wrong))
