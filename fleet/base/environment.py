"""Read settings from environment variables, with their types, and refuse missing or wrong ones.

Every error is an `ImproperlyConfigured` that begins with the variable's name and explains what to do.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit
from zoneinfo import available_timezones

from django.core.exceptions import ImproperlyConfigured

TRUE = {"1", "true", "yes", "on"}
FALSE = {"0", "false", "no", "off", ""}

MOST_DAYS = 100 * 365

SQLITE_OPTIONS = {
    "timeout": 5,  # seconds that a writer waits for another writer
    # A transaction that reads first and writes later would fail at once if another one wrote between the two.
    "transaction_mode": "IMMEDIATE",
    # FULL: committed records survive a power cut. secure_delete: erased data does not stay in the file.
    "init_command": "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA secure_delete=ON",
}
POSTGRESQL_OPTIONS = {
    "connect_timeout": "3",
    "options": "-c lock_timeout=5s",
    # If the network to the database breaks, the server sends nothing: without these timeouts, a writer would
    # wait for hours, and robots could not move.
    "tcp_user_timeout": "10000",  # ms
    "keepalives_idle": "5",
    "keepalives_interval": "2",
    "keepalives_count": "3",
}
LONGEST_QUERY_S = 30  # only for web processes
_HOST = re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9])?", re.IGNORECASE)
_BUCKET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{2,62}")
_PREFIX = re.compile(r"([\w.-]+(/[\w.-]+)*)?", re.ASCII)
_NUMBERS = re.compile(r"[0-9.]+")  # a wrong IP address, not a host name


class Environment:
    """The environment variables, with a method for each type."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        self._variables = variables

    def text(self, name: str) -> str | None:
        """Return the variable's text; None if it is unset or blank."""
        return self._variables.get(name, "").strip() or None

    def required(self, name: str, why: str) -> str:
        """Return the variable's text; it must be set."""
        value = self.text(name)
        if value is None:
            raise ImproperlyConfigured(f"{name} is not set. {why}")
        return value

    def flag(self, name: str) -> bool:
        """Return whether a switch is on; off unless set."""
        value = (self.text(name) or "").lower()
        if value not in TRUE | FALSE:
            raise ImproperlyConfigured(f"{name} is {value!r}; use 1 or 0.")
        return value in TRUE

    def names(self, name: str) -> list[str]:
        """Return the items of a comma-separated list; empty items are left out."""
        return [item.strip() for item in (self.text(name) or "").split(",") if item.strip()]

    def seconds(self, name: str, default: float, *, least: float) -> float:
        """Return a number of seconds, at least `least`."""
        value = self.text(name)
        try:
            seconds = default if value is None else float(value)
        except ValueError:
            seconds = float("nan")
        if not least <= seconds < float("inf"):
            raise ImproperlyConfigured(f"{name} is {value!r}; it is a number of seconds, {least:g} or more.")
        return seconds

    def days(self, name: str, default: int, *, least: int = 1) -> int:
        """Return a whole number of days, at least `least`."""
        value = self.text(name) or str(default)
        if not value.isdecimal() or not least <= int(value) <= MOST_DAYS:
            raise ImproperlyConfigured(
                f"{name} is {value!r}; it is a number of days from {least} to {MOST_DAYS}."
            )
        return int(value)

    def gigabytes(self, name: str, default: float) -> int:
        """Return a size in bytes, given in gigabytes."""
        value = self.text(name)
        try:
            gigabytes = default if value is None else float(value)
        except ValueError:
            gigabytes = float("nan")
        if not 0.0 < gigabytes < 1e6:
            raise ImproperlyConfigured(f"{name} is {value!r}; it is a number of gigabytes, above 0.")
        return int(gigabytes * 1e9)

    def folders(self, name: str, otherwise: str) -> list[Path]:
        """Return absolute folders, separated by colons, from this variable or else from `otherwise`."""
        named = self.text(name) or self.text(otherwise) or ""
        folders = [Path(folder).expanduser() for folder in named.split(":") if folder]
        if self.text(name):
            for folder in folders:
                if not folder.is_absolute() or not folder.is_dir():
                    raise ImproperlyConfigured(
                        f"{name}: {folder} is no folder. Name absolute folders, separated by colons."
                    )
        return folders

    def directory(self, name: str, default: Path) -> Path:
        """Return a directory that only its owner may open. Make it if it is missing.

        A person who could read the database in it could sign in as anybody, by the session keys. The default
        directory is closed to other accounts. A directory that somebody chose may have other uses: its mode
        is not changed, and it is refused if others may open it.
        """
        named = self.text(name)
        path = Path(named or default).expanduser().absolute()
        try:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            if named is None and path.stat().st_mode & 0o077:
                path.chmod(0o700)
        except OSError as error:
            raise ImproperlyConfigured(
                f"{name}: cannot make the directory {path} for its owner only: {error.strerror}."
            ) from error
        if path.stat().st_mode & 0o077:
            raise ImproperlyConfigured(
                f"{name}: other accounts of this computer may open the directory {path}. Run: chmod 700 {path}"
            )
        return path

    def file(self, name: str) -> str | None:
        """Return the path of a file; None if the variable is not set. The file must exist."""
        value = self.text(name)
        if value is not None and not Path(value).is_file():
            raise ImproperlyConfigured(f"{name}: there is no file {value}.")
        return value

    def secret(self, name: str, why: str) -> str:
        """Return a secret: the variable's text, or that of the file that `name`_FILE names. One must be set."""
        path = self.file(f"{name}_FILE")
        if path is None:
            return self.required(name, why)
        if self.text(name) is not None:
            raise ImproperlyConfigured(f"{name} and {name}_FILE are both set. Remove one of them.")
        try:
            value = Path(path).read_text().strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ImproperlyConfigured(f"{name}_FILE: the file {path} cannot be read: {error}.") from error
        if not value:
            raise ImproperlyConfigured(f"{name}_FILE: the file {path} is empty.")
        return value


def hosts(env: Environment, *, debug: bool) -> list[str]:
    """Return `FLEET_HOSTS`: the host names under which browsers may reach the console."""
    names = env.names("FLEET_HOSTS")
    if any("*" in name for name in names):
        raise ImproperlyConfigured(
            "FLEET_HOSTS contains '*'. List the names and addresses: the Origin check of WebSockets needs them."
        )
    if not names and not debug:
        raise ImproperlyConfigured(
            "FLEET_HOSTS is not set. List the names and addresses under which browsers reach the console, "
            "such as FLEET_HOSTS=fleet.lab.example,192.168.1.20."
        )
    return names or ["localhost", "127.0.0.1", "[::1]"]


def origins(env: Environment) -> list[str]:
    """Return `FLEET_ORIGINS`: further trusted origins, such as https://fleet.lab.example:8443."""
    values = env.names("FLEET_ORIGINS")
    for value in values:
        parts = urlsplit(value)
        if (
            parts.scheme not in ("http", "https")
            or not parts.hostname
            or value != f"{parts.scheme}://{parts.netloc}"
        ):
            raise ImproperlyConfigured(
                f"FLEET_ORIGINS contains {value!r}; an origin looks like https://fleet.example:8443, without a path."
            )
    return values


def secret_key(env: Environment) -> str:
    """Return `FLEET_SECRET_KEY`. It must be long and random: else attackers can forge sign-in cookies."""
    key = env.required(
        "FLEET_SECRET_KEY",
        "Make one with: python3 -c 'import secrets; print(secrets.token_urlsafe(50))', and keep it.",
    )
    if len(key) < 32:
        raise ImproperlyConfigured(f"FLEET_SECRET_KEY has {len(key)} characters; it needs 32 or more.")
    return key


def link_secret(env: Environment) -> str | None:
    """Return `FLEET_LINK_SECRET`, which web processes and bridges on other hosts share; None if not set.

    The other settings of a TLS link need it.
    """
    secret = env.text("FLEET_LINK_SECRET")
    if secret is not None and len(secret) < 32:
        raise ImproperlyConfigured(f"FLEET_LINK_SECRET has {len(secret)} characters; it needs 32 or more.")
    if secret is None and any(env.text(f"FLEET_LINK_{part}") for part in ("CA", "CERT", "KEY")):
        raise ImproperlyConfigured(
            "FLEET_LINK_SECRET is not set, but FLEET_LINK_CA, FLEET_LINK_CERT or FLEET_LINK_KEY is. "
            "A link over TCP needs the shared secret as well."
        )
    if bool(env.text("FLEET_LINK_CERT")) != bool(env.text("FLEET_LINK_KEY")):
        raise ImproperlyConfigured("FLEET_LINK_CERT and FLEET_LINK_KEY go together; one of them is not set.")
    return secret


def lichtblick(env: Environment) -> Path | None:
    """Return `FLEET_LICHTBLICK`: the folder of a Lichtblick build that the console serves; None if not set."""
    value = env.text("FLEET_LICHTBLICK")
    if value is None:
        return None
    folder = Path(value).expanduser().absolute()
    try:
        page = (folder / "index.html").read_text(errors="replace")
    except OSError:
        page = ""
    if "<script" not in page or not any(folder.glob("*.js")):
        raise ImproperlyConfigured(
            f"FLEET_LICHTBLICK: {folder} is no build of Lichtblick. Name the folder that holds its index.html and "
            "main….js: of the source, web/.webpack after a build; of its container image, /src."
        )
    return folder


def recordings(env: Environment, default: Path) -> Path | None:
    """Return `FLEET_RECORDINGS`: the folder of recordings on this computer; None: it keeps none."""
    value = env.text("FLEET_RECORDINGS")
    if value is None:
        return default
    if value.lower() in FALSE:
        return None
    folder = Path(value).expanduser()
    if not folder.is_absolute():
        raise ImproperlyConfigured(
            f"FLEET_RECORDINGS is {value!r}; it is an absolute folder, or off. Its parent must exist."
        )
    return folder


@dataclass(frozen=True)
class ObjectStore:
    """An S3-compatible store: one bucket, and how all names of the console's objects in it begin."""

    endpoint: str  # such as https://minio.lab.example:9000
    bucket: str
    prefix: str  # empty, or with a slash at its end
    region: str
    key: str
    secret: str = field(repr=False)


def object_store(env: Environment) -> ObjectStore | None:
    """Return the store of `FLEET_S3_URL`, such as https://minio.lab.example:9000/BUCKET/PREFIX; None if not set."""
    url = env.text("FLEET_S3_URL")
    if url is None:
        return None
    parts, _ = _split("FLEET_S3_URL", url)
    bucket, _, prefix = parts.path.strip("/").partition("/")
    if (
        parts.scheme not in ("http", "https")
        or not parts.hostname
        or "@" in parts.netloc
        or parts.query
        or parts.fragment
        or not _BUCKET.fullmatch(bucket)
        or not _PREFIX.fullmatch(prefix)
    ):
        raise ImproperlyConfigured(
            "FLEET_S3_URL looks like https://minio.lab.example:9000/BUCKET or https://…/BUCKET/PREFIX; "
            "the key is in FLEET_S3_KEY."
        )
    why = "FLEET_S3_URL is. The object store gives it for the console."
    return ObjectStore(
        f"{parts.scheme}://{parts.netloc}",
        bucket,
        f"{prefix}/" if prefix else "",
        env.text("FLEET_S3_REGION") or "us-east-1",
        env.required("FLEET_S3_KEY", why),
        env.secret("FLEET_S3_SECRET", why),
    )


class WebhookAllow(NamedTuple):
    """Private networks and hosts to which webhooks, or pushes, may be sent."""

    networks: tuple[IPv4Network | IPv6Network, ...] = ()
    hosts: frozenset[str] = frozenset()


def webhook_allow(env: Environment, variable: str = "FLEET_WEBHOOK_ALLOW") -> WebhookAllow:
    """Return `FLEET_WEBHOOK_ALLOW`: networks and hosts, such as `10.1.0.0/16,ci.lab.example`."""
    networks, hosts = [], set()
    for name in env.names(variable):
        try:
            networks.append(ip_network(name))
        except ValueError as error:
            if not _HOST.fullmatch(name) or _NUMBERS.fullmatch(name):
                raise ImproperlyConfigured(
                    f"{variable} contains {name!r}; use networks such as 10.1.0.0/16 and names of hosts."
                ) from error
            hosts.add(name.lower())
    return WebhookAllow(tuple(networks), frozenset(hosts))


def redis_url(env: Environment) -> str | None:
    """Return `FLEET_REDIS_URL`: the channel layer, for several web processes; None if not set."""
    url = env.text("FLEET_REDIS_URL")
    if url is not None and urlsplit(url).scheme not in ("redis", "rediss", "unix"):
        raise ImproperlyConfigured(
            f"FLEET_REDIS_URL is {url.rpartition('@')[2]!r}; it looks like redis://host:6379/0, or rediss:// for TLS."
        )
    return url


def time_zone(env: Environment) -> str:
    """Return `FLEET_TIME_ZONE`: the lab's time zone by its IANA name, such as Europe/Madrid."""
    name = env.text("FLEET_TIME_ZONE") or "UTC"
    if name not in available_timezones():
        raise ImproperlyConfigured(
            f"FLEET_TIME_ZONE is {name!r}, which is no time zone. Use an IANA name, such as Europe/Madrid."
        )
    return name


def _split(name: str, url: str) -> tuple[SplitResult, int | None]:
    """Return the parts of a URL, and its port."""
    try:
        parts = urlsplit(url)
        return parts, parts.port
    except ValueError as error:
        raise ImproperlyConfigured(f"{name} cannot be read: {error}.") from error


def email(env: Environment) -> dict[str, Any]:
    """Return Django's settings for `FLEET_EMAIL_URL`, the mail server.

    Examples: `smtp://user:password@host:587` (STARTTLS), `smtps://host:465` (TLS), or `smtp://host:25`: a
    relay in one's own network, without user and without TLS.

    Without the variable, no e-mail is sent, and the log says to whom.
    """
    url = env.text("FLEET_EMAIL_URL")
    if url is None:
        return {"EMAIL_BACKEND": "fleet.accounts.mail.off.EmailBackend"}
    parts, port = _split("FLEET_EMAIL_URL", url)
    if parts.scheme not in ("smtp", "smtps") or not parts.hostname:
        raise ImproperlyConfigured(
            "FLEET_EMAIL_URL looks like smtp://user:password@host:587, or smtps://host:465."
        )
    return {
        "EMAIL_BACKEND": "django.core.mail.backends.smtp.EmailBackend",
        "EMAIL_HOST": parts.hostname,
        "EMAIL_PORT": port or (465 if parts.scheme == "smtps" else 587),
        "EMAIL_HOST_USER": unquote(parts.username or ""),
        "EMAIL_HOST_PASSWORD": unquote(parts.password or ""),
        "EMAIL_USE_SSL": parts.scheme == "smtps",
        "EMAIL_USE_TLS": parts.scheme == "smtp" and bool(parts.username),
        "EMAIL_TIMEOUT": 10,
    }


def single_sign_on(env: Environment) -> dict[str, Any]:
    """Return django-allauth's settings for an OpenID Connect provider; empty without `FLEET_OIDC_URL`.

    Variables: `FLEET_OIDC_URL`, `FLEET_OIDC_CLIENT_ID`, `FLEET_OIDC_SECRET`, `FLEET_OIDC_NAME`. The URL is
    that of the issuer, such as https://login.example.org/realms/lab.
    """
    url = env.text("FLEET_OIDC_URL")
    if url is None:
        return {}
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ImproperlyConfigured(
            f"FLEET_OIDC_URL is {url!r}; it looks like https://login.example.org/realms/lab."
        )
    why = "FLEET_OIDC_URL is. The provider gives it when the console is registered there."
    app = {
        "provider_id": "sso",
        "name": env.text("FLEET_OIDC_NAME") or parts.hostname,
        "client_id": env.required("FLEET_OIDC_CLIENT_ID", why),
        "secret": env.required("FLEET_OIDC_SECRET", why),
        "settings": {"server_url": url, "oauth_pkce_enabled": True},
    }
    return {"openid_connect": {"APPS": [app]}}


def database(url: str) -> dict[str, Any]:
    """Return a `DATABASES` entry for `FLEET_DATABASE_URL`.

    Examples: `sqlite:////var/lib/fleet/fleet.sqlite3` (an absolute path has four slashes) or
    `postgresql://user:password@host:5432/name?sslmode=require`; the part after `?` goes to the driver.
    """
    parts, port = _split("FLEET_DATABASE_URL", url)
    name = unquote(parts.path).removeprefix("/")
    if parts.scheme not in ("sqlite", "postgres", "postgresql") or not name:
        raise ImproperlyConfigured(
            "FLEET_DATABASE_URL must look like sqlite:////path/fleet.sqlite3 or postgresql://user:password@host/name."
        )
    if parts.scheme == "sqlite":
        return {"ENGINE": "fleet.base.database.sqlite", "NAME": name, "OPTIONS": dict(SQLITE_OPTIONS)}
    return {
        "ENGINE": "django.db.backends.postgresql",
        "NAME": name,
        "USER": unquote(parts.username or ""),
        "PASSWORD": unquote(parts.password or ""),
        "HOST": unquote(parts.hostname or ""),
        "PORT": str(port or ""),
        "OPTIONS": POSTGRESQL_OPTIONS | dict(parse_qsl(parts.query)),
    }


def limit_queries(database: dict[str, Any]) -> None:
    """Let PostgreSQL end long queries of a web process: it has few threads, and people wait.

    Queries of commands are not limited: verifying or migrating may take long. Options in the URL have
    precedence, also for commands.
    """
    if database["ENGINE"].endswith("postgresql"):
        options = database["OPTIONS"]
        options["options"] = f"-c statement_timeout={LONGEST_QUERY_S}s {options['options']}"
