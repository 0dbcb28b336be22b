"""Settings, from environment variables that begin with FLEET_ (docs/settings.md lists them).

Without FLEET_DEBUG everything is as strict as in production. If a variable is missing or wrong, the start
fails with the variable's name.
"""

import hashlib
import os
import sys
from pathlib import Path
from typing import Any

from csp.constants import NONE, SELF
from django.core.management.utils import get_random_secret_key

from fleet.base import environment, languages, logs
from fleet.base.environment import Environment

os.umask(0o077)  # other accounts cannot read files of the console: the database contains session keys

BASE_DIR = Path(__file__).resolve().parent.parent
_env = Environment(os.environ)

DEBUG = _env.flag("FLEET_DEBUG")
FLEET_TLS = _env.flag("FLEET_TLS")  # browsers reach the console by https, directly or through a proxy
FLEET_VAR = _env.directory("FLEET_VAR", BASE_DIR / "var")
FLEET_RUN_DIR = _env.directory("FLEET_RUN_DIR", FLEET_VAR / "run")
FLEET_ORIGINS = environment.origins(_env)
FLEET_BRIDGE_HOST = (_env.text("FLEET_BRIDGE_HOST") or "").lower()
FLEET_LINK_SECRET = environment.link_secret(_env)
FLEET_LINK_CA = _env.file("FLEET_LINK_CA")
FLEET_LINK_CERT = _env.file("FLEET_LINK_CERT")
FLEET_LINK_KEY = _env.file("FLEET_LINK_KEY")

# Folders of ROS packages that contain the meshes of robots' descriptions.
FLEET_MESHES = _env.folders("FLEET_MESHES", otherwise="ROS_PACKAGE_PATH")
FLEET_LICHTBLICK = environment.lichtblick(_env)
FLEET_RECORDINGS = environment.recordings(_env, FLEET_VAR / "recordings")
FLEET_RECORDINGS_BYTES = _env.gigabytes("FLEET_RECORDINGS_GB", 20.0)
FLEET_RECORDINGS_FREE_BYTES = _env.gigabytes("FLEET_RECORDINGS_FREE_GB", 2.0)
FLEET_S3 = environment.object_store(_env)
FLEET_RECORDINGS_PERSON_BYTES = _env.gigabytes("FLEET_RECORDINGS_PERSON_GB", 10.0)
FLEET_RECORDINGS_ROBOT_BYTES = _env.gigabytes("FLEET_RECORDINGS_ROBOT_GB", 100.0)
FLEET_RECORD_EVERY_BOOKING = _env.flag("FLEET_RECORD_EVERY_BOOKING")
# Days from the end of a recording, by its kind. One that somebody keeps stays.
FLEET_RECORDINGS_KEEP_DAYS = {
    "black_box": _env.days("FLEET_RECORDINGS_KEEP_BLACK_BOX_DAYS", 14),
    "by_hand": _env.days("FLEET_RECORDINGS_KEEP_BY_HAND_DAYS", 90),
    "booking": _env.days("FLEET_RECORDINGS_KEEP_BOOKING_DAYS", 180),
}

FLEET_CONTROL_TERM_S = _env.seconds("FLEET_CONTROL_TERM_S", 900, least=10)  # control ends unless renewed

# Days that the audit log keeps contents, by the retention classes of fleet.audit.kinds, and whole records.
FLEET_AUDIT_KEEP_DAYS = {
    "speech": _env.days("FLEET_AUDIT_KEEP_SPEECH_DAYS", 90),
    "driving": _env.days("FLEET_AUDIT_KEEP_DRIVING_DAYS", 365),
    "other": _env.days("FLEET_AUDIT_KEEP_OTHER_DAYS", 730),
}
FLEET_AUDIT_KEEP_RECORDS_DAYS = _env.days("FLEET_AUDIT_KEEP_RECORDS_DAYS", 5 * 366, least=365)

FLEET_BACKUP_PASSPHRASE = _env.text("FLEET_BACKUP_PASSPHRASE")

# In debug, the default is a key for this process only: sign-ins end with the process.
SECRET_KEY = (
    get_random_secret_key() if DEBUG and not _env.text("FLEET_SECRET_KEY") else environment.secret_key(_env)
)
ALLOWED_HOSTS = environment.hosts(_env, debug=DEBUG)
CSRF_TRUSTED_ORIGINS = FLEET_ORIGINS

INSTALLED_APPS = [
    "django.contrib.admin",
    "django.contrib.auth",
    "django.contrib.humanize",
    "django.contrib.contenttypes",
    "django.contrib.sessions",
    "django.contrib.messages",
    "fleet.site.apps.StaticFiles",
    "rest_framework",
    "csp",
    "allauth",
    "allauth.account",
    "allauth.mfa",
    "allauth.socialaccount",
    "allauth.socialaccount.providers.openid_connect",
    "drf_spectacular",
    "fleet.site",
    "fleet.audit",
    "fleet.backup",
    "fleet.accounts",
    "robots.registry",
    "robots.access",
    "robots.places",
    "robots.recordings",
    "fleet.bookings",
    "teleop",
]
# The records process writes records of bridges, the store process moves files: the other apps would take 25 MB.
FLEET_SOME_APPS = sys.argv[1:2] in (["run_records"], ["run_store"])
if FLEET_SOME_APPS:
    INSTALLED_APPS = [
        "django.contrib.auth",
        "django.contrib.contenttypes",
        "django.contrib.sessions",
        "fleet.site.apps.Commands",
        "fleet.audit",
        "fleet.accounts.apps.Models",
        "robots.registry",
        "robots.recordings",
    ]
elif DEBUG:
    INSTALLED_APPS.insert(0, "daphne")  # so that `manage.py runserver` serves WebSockets, too

MIDDLEWARE = [
    "teleop.api.metrics.measured",
    "fleet.site.headers.request_ids",
    "django.middleware.security.SecurityMiddleware",
    "fleet.site.headers.permissions_policy",
    "csp.middleware.CSPMiddleware",
    "whitenoise.middleware.WhiteNoiseMiddleware",
    "django.contrib.sessions.middleware.SessionMiddleware",
    "django.middleware.locale.LocaleMiddleware",
    "django.middleware.common.CommonMiddleware",
    "django.middleware.csrf.CsrfViewMiddleware",
    "django.contrib.auth.middleware.AuthenticationMiddleware",
    "fleet.accounts.middleware.few_fields_of_strangers",
    "allauth.account.middleware.AccountMiddleware",
    "fleet.site.pages.setup.leads_to_setup",
    "fleet.accounts.middleware.SignInRequired",
    "fleet.accounts.sign_in.second_factor.required",
    "fleet.accounts.middleware.ViewersChoices",
    "fleet.accounts.middleware.sign_in_seen",
    "django.contrib.messages.middleware.MessageMiddleware",
    "fleet.site.pages.unavailable.UnavailableInWords",
    "django.middleware.clickjacking.XFrameOptionsMiddleware",
]

# A course may have as many people as a list has lines (5,000), each with a box to tick.
DATA_UPLOAD_MAX_NUMBER_FIELDS = 10_000

ROOT_URLCONF = "fleet.site.urls"
ASGI_APPLICATION = "fleet.site.asgi.application"

TEMPLATES = [
    {
        "BACKEND": "django.template.backends.django.DjangoTemplates",
        "DIRS": [BASE_DIR / "templates"],
        "APP_DIRS": True,
        "OPTIONS": {
            "context_processors": [
                "django.template.context_processors.request",
                "django.contrib.auth.context_processors.auth",
                "django.contrib.messages.context_processors.messages",
                "fleet.bookings.pages.news.news",
                "fleet.site.pages.navigation.navigation",
                "fleet.accounts.mail.off.mail",
            ],
            "builtins": ["fleet.base.formats.filters"],
        },
    }
]

# --- database, channel layer ------------------------------------------------------------------

DATABASES: dict[str, dict[str, Any]] = {
    "default": environment.database(
        _env.text("FLEET_DATABASE_URL") or f"sqlite:///{FLEET_VAR / 'fleet.sqlite3'}"
    )
}
# For used second-factor codes and allauth's counts, which all web processes share.
CACHES = {"default": {"BACKEND": "django.core.cache.backends.db.DatabaseCache", "LOCATION": "fleet_cache"}}
DEFAULT_AUTO_FIELD = "django.db.models.BigAutoField"

_redis_url = environment.redis_url(_env)
CHANNEL_LAYERS: dict[str, dict[str, Any]] = {
    "default": {
        "BACKEND": "channels_redis.core.RedisChannelLayer",
        "CONFIG": {"hosts": [_redis_url], "prefix": "fleet"},
    }
    if _redis_url
    else {"BACKEND": "channels.layers.InMemoryChannelLayer"}
}

globals().update(environment.email(_env))
DEFAULT_FROM_EMAIL = _env.text("FLEET_EMAIL_FROM") or "fleet-console@localhost"
FLEET_WEBHOOK_ALLOW = environment.webhook_allow(_env)
FLEET_PUSH_ALLOW = environment.webhook_allow(_env, "FLEET_PUSH_ALLOW")

# --- people -----------------------------------------------------------------------------------

AUTH_USER_MODEL = "accounts.User"
AUTHENTICATION_BACKENDS = ["fleet.accounts.sign_in.backends.StaffBackend"]
PASSWORD_HASHERS = [
    "fleet.accounts.sign_in.hashing.BCryptInProcesses",
    "django.contrib.auth.hashers.PBKDF2PasswordHasher",
]
AUTH_PASSWORD_VALIDATORS = [
    {"NAME": f"django.contrib.auth.password_validation.{name}"}
    for name in (
        "UserAttributeSimilarityValidator",
        "MinimumLengthValidator",
        "CommonPasswordValidator",
        "NumericPasswordValidator",
    )
]
LOGIN_URL = "sign-in"
LOGIN_REDIRECT_URL = "fleet"
LOGOUT_REDIRECT_URL = "sign-in"

# Sign-in by django-allauth. Failed sign-ins are limited by fleet.accounts.sign_in.throttle: allauth's own
# limits would lock out a class that shares one address. Allauth limits the e-mails to one e-mail address.
FLEET_STAFF_TWO_FACTOR = _env.flag("FLEET_STAFF_TWO_FACTOR")
ACCOUNT_ADAPTER = "fleet.accounts.sign_in.adapters.AccountAdapter"
ACCOUNT_LOGIN_METHODS = {"username", "email"}
ACCOUNT_SIGNUP_FIELDS = ["username*", "email", "password1*", "password2*"]  # only for single sign-on
ACCOUNT_EMAIL_VERIFICATION = "none"  # for addresses that staff enter; a change by the person is verified
ACCOUNT_CHANGE_EMAIL = True
ACCOUNT_REAUTHENTICATION_REQUIRED = True  # before a change of the address or of the second factor
ACCOUNT_EMAIL_UNKNOWN_ACCOUNTS = False
ACCOUNT_EMAIL_NOTIFICATIONS = True
ACCOUNT_FORMS = {"add_email": "fleet.accounts.sign_in.forms.EmailForm"}
ACCOUNT_RATE_LIMITS = {
    **dict.fromkeys(
        ("change_password", "login", "login_failed", "reauthenticate", "reset_password_from_key")
    ),
    "reset_password": "3/10m/key",
}
MFA_ADAPTER = "fleet.accounts.sign_in.adapters.SecondFactorAdapter"
MFA_SUPPORTED_TYPES = ["totp", "webauthn", "recovery_codes"]
MFA_PASSKEY_LOGIN_ENABLED = True
MFA_ALLOW_UNVERIFIED_EMAIL = True
MFA_TOTP_ISSUER = "Fleet console"
MFA_RATE_LIMITS = False
MFA_FORMS = {
    "authenticate": "fleet.accounts.sign_in.second_factor.CodeForm",
    "reauthenticate": "fleet.accounts.sign_in.second_factor.CodeAgainForm",
}
SOCIALACCOUNT_ADAPTER = "fleet.accounts.sign_in.adapters.SingleSignOnAdapter"
SOCIALACCOUNT_LOGIN_ON_GET = True  # by a link: the content security policy forbids forms to another host
SOCIALACCOUNT_PROVIDERS = environment.single_sign_on(_env)

SESSION_ENGINE = "fleet.accounts.sign_in.sessions"
SESSION_COOKIE_AGE = 12 * 60 * 60  # seconds since the last page was opened: a working day
SESSION_COOKIE_SECURE = CSRF_COOKIE_SECURE = FLEET_TLS
# Cookies belong to hosts, not to ports: with equal names, two consoles on a host would end each other's
# sign-ins.
_console = hashlib.sha256(SECRET_KEY.encode()).hexdigest()[:8]
SESSION_COOKIE_NAME = f"fleet_session_{_console}"
CSRF_COOKIE_NAME = f"fleet_csrf_{_console}"
SESSION_COOKIE_SAMESITE = CSRF_COOKIE_SAMESITE = "Lax"
SESSION_COOKIE_HTTPONLY = True
# Messages are stored in the session, so that the console needs no third cookie.
MESSAGE_STORAGE = "django.contrib.messages.storage.session.SessionStorage"

REST_FRAMEWORK = {
    "DEFAULT_AUTHENTICATION_CLASSES": ["rest_framework.authentication.SessionAuthentication"],
    "DEFAULT_PERMISSION_CLASSES": ["rest_framework.permissions.IsAuthenticated"],
    "DEFAULT_RENDERER_CLASSES": ["rest_framework.renderers.JSONRenderer"],
    "DEFAULT_PARSER_CLASSES": ["rest_framework.parsers.JSONParser"],
    "DEFAULT_SCHEMA_CLASS": "teleop.api.v1.framework.schema.OperationSchema",
    "URL_FORMAT_OVERRIDE": None,  # the API itself has a parameter `format`
    "EXCEPTION_HANDLER": "teleop.api.v1.framework.problems.response_of",
}
SPECTACULAR_SETTINGS = {
    "TITLE": "Fleet console",
    "DESCRIPTION": "Robots, control, bookings and the log: the chain of the pages, for programs.",
    "VERSION": "1",
    "OAS_VERSION": "3.1.1",
    "SCHEMA_PATH_PREFIX": r"/api/v1",
    "SERVE_INCLUDE_SCHEMA": False,
    "SERVE_PERMISSIONS": ["rest_framework.permissions.AllowAny"],
    "SERVE_AUTHENTICATION": [],
    "POSTPROCESSING_HOOKS": ["teleop.api.v1.framework.schema.with_stops"],
}

# --- headers for browsers ---------------------------------------------------------------------

CONTENT_SECURITY_POLICY = {
    "DIRECTIVES": {
        "default-src": [NONE],
        "script-src": [SELF],
        "style-src": [SELF],
        "img-src": [SELF],
        "manifest-src": [SELF],
        "connect-src": [SELF],  # for browsers, ws: and wss: of the same host are 'self', too
        "form-action": [SELF],
        "base-uri": [NONE],
        "frame-ancestors": [NONE],
    }
}
X_FRAME_OPTIONS = "DENY"
SECURE_REFERRER_POLICY = "same-origin"
# On plain http from another host, browsers ignore this header and write an error to their console.
SECURE_CROSS_ORIGIN_OPENER_POLICY = "same-origin" if FLEET_TLS else None
SECURE_HSTS_SECONDS = 365 * 24 * 60 * 60 if FLEET_TLS else 0

# These checks are about settings that FLEET_TLS switches together; fleet.W003 reports it. Others are about
# subdomains; the console cannot know whether its host name has subdomains or other http services.
SILENCED_SYSTEM_CHECKS = [f"security.W{number}" for number in ("004", "005", "008", "012", "016", "021")]

# --- static files -----------------------------------------------------------------------------

# The browser libraries of the pages: the folder under /static/, and the folder into which npm installs them.
NPM_DISTRIBUTIONS = [
    ("vendor/event-calendar", BASE_DIR / "node_modules/@event-calendar/build/dist"),
    ("vendor/scene", BASE_DIR / "node_modules/.scene"),  # made by npm: see script/scene_library.js
    ("vendor/swagger-ui", BASE_DIR / "node_modules/swagger-ui-dist"),
    ("vendor/uplot", BASE_DIR / "node_modules/uplot/dist"),
]
STATIC_URL = "/static/"
STATIC_ROOT = FLEET_VAR / "static"
STATICFILES_DIRS: list[Any] = [
    BASE_DIR / "static",
    *(distribution for distribution in NPM_DISTRIBUTIONS if distribution[1].is_dir()),
]
STORAGES = {
    "default": {"BACKEND": "django.core.files.storage.FileSystemStorage"},
    "staticfiles": {
        "BACKEND": "django.contrib.staticfiles.storage.StaticFilesStorage"
        if DEBUG
        else "fleet.site.static.HashedStaticFiles"
    },
}
WHITENOISE_USE_FINDERS = WHITENOISE_AUTOREFRESH = DEBUG

# --- language, time, logging ------------------------------------------------------------------

LANGUAGE_CODE = "en-gb"  # the language of the source; a browser may ask for another language in LANGUAGES
LOCALE_PATHS = [BASE_DIR / "fleet/locale"]
LANGUAGES = languages.spoken(LANGUAGE_CODE, LOCALE_PATHS[0])
FORMAT_MODULE_PATH = "fleet.base.formats"
TIME_ZONE = environment.time_zone(_env)  # the lab's zone; the database stores UTC
USE_TZ = True

FLEET_LOG_JSON = _env.flag("FLEET_LOG_JSON")
LOGGING = {
    "version": 1,
    "disable_existing_loggers": False,
    "formatters": {
        "line": {"()": logs.Redacted, "fmt": logs.LINE, "style": "{"},
        "json": {"()": logs.Json},
    },
    "filters": {"one_line": {"()": "django.utils.log.CallbackFilter", "callback": logs.one_line}},
    "handlers": {
        "stderr": {
            "class": "logging.StreamHandler",
            "formatter": "json" if FLEET_LOG_JSON else "line",
            "filters": ["one_line"],
        }
    },
    "root": {"handlers": ["stderr"], "level": "INFO"},
    "loggers": {
        "django": {"handlers": ["stderr"], "level": "INFO", "propagate": False},
        # No line for each request: the audit log has better information.
        "django.channels.server": {"level": "WARNING"},
        "daphne": {"level": "WARNING"},
        "uvicorn": {"level": "ERROR"},  # no warnings about each unreadable request and about its own end
        "websockets": {
            "level": "WARNING"
        },  # links often connect and disconnect; robots.link.client and the bridge log important events
    },
}
