"""The product's settings with a temporary directory and database for this test run.

Set FLEET_DATABASE_URL to run the tests on a PostgreSQL server.
"""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

if "PYTEST_VERSION" in os.environ:
    _directory = tempfile.mkdtemp(prefix="fleet-test-")
    atexit.register(shutil.rmtree, _directory, ignore_errors=True)
else:  # mypy and the migrations check read these settings too, and mypy does not clean up
    _directory = str(Path(__file__).resolve().parent.parent / "var/checks")

for _name in [name for name in os.environ if name.startswith("FLEET_") and name != "FLEET_DATABASE_URL"]:
    del os.environ[_name]
os.environ["FLEET_VAR"] = _directory
os.environ["FLEET_SECRET_KEY"] = "a key for tests, which protects nothing at all"
os.environ["FLEET_HOSTS"] = "testserver,localhost,127.0.0.1"

from fleet.settings import *  # noqa: E402, F403
from fleet.settings import DATABASES, FLEET_VAR, PASSWORD_HASHERS, STORAGES  # noqa: E402

# A file, not memory: connections of several threads must wait for each other as in production.
DATABASES["default"]["TEST"] = {
    "NAME": f"{_directory}/test.sqlite3"
    if "sqlite" in DATABASES["default"]["ENGINE"]
    else f"test_fleet_{os.getpid()}"
}
if (
    "init_command" in DATABASES["default"]["OPTIONS"]
):  # SQLite: no test cuts the power, and each commit would wait
    DATABASES["default"]["OPTIONS"]["init_command"] += "; PRAGMA synchronous=OFF"
(FLEET_VAR / "static").mkdir(exist_ok=True)  # without it, WhiteNoise warns
STORAGES["staticfiles"]["BACKEND"] = "django.contrib.staticfiles.storage.StaticFilesStorage"
PRODUCTION_PASSWORD_HASHERS = PASSWORD_HASHERS
# Fast: bcrypt takes 0.25 s each time.
PASSWORD_HASHERS = ["django.contrib.auth.hashers.MD5PasswordHasher"]
