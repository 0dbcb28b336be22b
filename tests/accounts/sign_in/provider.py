"""An OpenID Connect provider in a process of its own: django-allauth's identity provider.

`python -m tests.accounts.sign_in.provider FOLDER CALLBACK` prints its port, and serves until it is ended.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, make_server

import django
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from django.conf import settings
from django.core.management import call_command
from django.core.wsgi import get_wsgi_application
from django.urls import include, path

CLIENT, SECRET = "fleet-console", "the secret of the console"
PASSWORD = "the password at the university"
PEOPLE = {  # whether the provider has verified the address
    "ada": True,
    "eve": False,
}

urlpatterns: list[object] = []


class Quiet(WSGIRequestHandler):
    """Prints no line for each request."""

    def log_message(self, format: str, *arguments: object) -> None:
        """Do nothing."""


class Claims:
    """Made when Django is ready: adds the person's groups, which tests write as JSON into a file."""

    def __new__(cls) -> Any:
        from allauth.idp.oidc.adapter import DefaultOIDCAdapter

        class Adapter(DefaultOIDCAdapter):
            def get_claims(self, purpose: Any, user: Any, client: Any, scopes: Any, **more: Any) -> Any:
                file = settings.GROUPS_FILE
                groups = json.loads(file.read_text()) if file.exists() else {}
                claims = super().get_claims(purpose, user, client, scopes, **more)
                return {**claims, "groups": groups.get(user.username, [])}

        return Adapter()


def serve(folder: Path, callback: str) -> None:
    """Make the database with client and people, and serve."""
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    apps = ("auth", "contenttypes", "sessions", "messages", "humanize")
    settings.configure(
        SECRET_KEY="x" * 50,
        ALLOWED_HOSTS=["127.0.0.1"],
        ROOT_URLCONF=__name__,
        USE_TZ=True,
        INSTALLED_APPS=[
            *(f"django.contrib.{app}" for app in apps),
            "allauth",
            "allauth.account",
            "allauth.idp.oidc",
        ],
        MIDDLEWARE=[
            "django.contrib.sessions.middleware.SessionMiddleware",
            "django.contrib.auth.middleware.AuthenticationMiddleware",
            "django.contrib.messages.middleware.MessageMiddleware",
            "allauth.account.middleware.AccountMiddleware",
        ],
        TEMPLATES=[
            {
                "BACKEND": "django.template.backends.django.DjangoTemplates",
                "APP_DIRS": True,
                "OPTIONS": {"context_processors": ["django.template.context_processors.request"]},
            }
        ],
        DATABASES={"default": {"ENGINE": "django.db.backends.sqlite3", "NAME": folder / "provider.sqlite3"}},
        DEFAULT_AUTO_FIELD="django.db.models.BigAutoField",
        PASSWORD_HASHERS=["django.contrib.auth.hashers.MD5PasswordHasher"],
        ACCOUNT_EMAIL_VERIFICATION="none",
        ACCOUNT_RATE_LIMITS=False,
        IDP_OIDC_PRIVATE_KEY=pem.decode(),
        IDP_OIDC_ADAPTER=f"{__name__}.Claims",
        GROUPS_FILE=folder / "groups.json",
    )
    django.setup()
    urlpatterns[:] = [path("", include("allauth.idp.urls")), path("accounts/", include("allauth.urls"))]
    call_command("migrate", verbosity=0)
    _fill(callback)
    with make_server("127.0.0.1", 0, get_wsgi_application(), handler_class=Quiet) as server:
        print(server.server_port, flush=True)
        server.serve_forever()


def _fill(callback: str) -> None:
    from allauth.account.models import EmailAddress
    from allauth.idp.oidc.models import Client
    from django.contrib.auth.models import User

    client = Client(id=CLIENT, name="Fleet console", skip_consent=True)
    client.set_secret(SECRET)
    client.set_scopes(["openid", "profile", "email"])
    client.set_redirect_uris([callback])
    client.save()
    for name, verified in PEOPLE.items():
        user = User.objects.create_user(
            name, f"{name}@lab.example", PASSWORD, first_name=name.title(), last_name="Lovelace"
        )
        EmailAddress.objects.create(user=user, email=user.email, verified=verified, primary=True)


if __name__ == "__main__":
    serve(Path(sys.argv[1]), sys.argv[2])
