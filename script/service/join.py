"""Join a console as a bridge host: `python -m script.service.join ADDRESS CODE --env FILE --owner USER`.

The key of the certificate is made here and stays here. The settings go into a new FILE, key and certificates beside it.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import secrets
import shlex
import shutil
import ssl
import sys
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from script.stack.places import private_file

PATIENCE_S = 30.0


class NotJoined(Exception):
    """The console refused, or cannot be reached; the text says why."""


def main() -> int:
    """Join, and return the exit status."""
    parser = argparse.ArgumentParser(prog="script/install-service bridges --join")
    parser.add_argument("address")
    parser.add_argument("code")
    parser.add_argument("--env", type=Path, required=True)
    parser.add_argument("--owner", required=True, help="the user of the service, who reads the key")
    asked = parser.parse_args()
    try:
        join(asked.address, asked.code, asked.env, asked.owner)
    except (NotJoined, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def join(address: str, code: str, env: Path, owner: str) -> None:
    """Get settings and certificate, and write them. Raises `NotJoined`."""
    if not address.startswith("https://"):
        raise NotJoined("The address must begin with https://, because it hands over secrets.")
    files = {
        "FLEET_LINK_CERT": env.with_suffix(".crt"),
        "FLEET_LINK_KEY": env.with_suffix(".key"),
        "FLEET_LINK_CA": env.with_name(
            f"{env.stem}-authority.crt"
        ),  # a stop typed here reaches other computers
    }
    # Before the code is used. fleet.key may be the one that browsers know.
    if there := [str(path) for path in (env, *files.values()) if os.path.lexists(path)]:
        raise NotJoined(
            f"{', '.join(there)}: there already. Move it away first, or give another name by --env."
        )
    key = ec.generate_private_key(ec.SECP256R1())
    request = x509.CertificateSigningRequestBuilder().subject_name(x509.Name([])).sign(key, hashes.SHA256())
    pem = request.public_bytes(serialization.Encoding.PEM).decode()
    joined = ask(address, {"code": code, "certificate_request": pem})
    private_key = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    texts = (joined["certificate"], private_key.decode(), joined["authority"])
    for path, text in zip(files.values(), texts, strict=True):
        private_file(path, text)
        shutil.chown(path, owner)
    own = {
        "FLEET_SECRET_KEY": secrets.token_urlsafe(50),
        "FLEET_HOSTS": "localhost",
    }  # no pages are served here
    settings = {**own, **joined["settings"], **{name: str(path) for name, path in files.items()}}
    private_file(env, "".join(f"{name}={_quoted(value)}\n" for name, value in settings.items()))
    print(f"Joined as {settings['FLEET_BRIDGE_HOST']}. Wrote {env}.")


def _quoted(value: str) -> str:
    """Return a value as systemd reads it; without quotes if it needs none, because containers take them literally."""
    return shlex.quote(value) if re.search(r"[\s'\"\\]", value) else value


def ask(address: str, body: dict[str, str]) -> dict[str, Any]:
    """Send the code to the console, and return its answer. Raises `NotJoined`."""
    request = urllib.request.Request(  # noqa: S310 - https, see above
        address, json.dumps(body).encode(), {"Content-Type": "application/json"}
    )
    trusted = ssl.create_default_context(cafile=os.environ.get("FLEET_JOIN_CA"))
    opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=trusted), NoRedirects())
    try:
        with opener.open(request, timeout=PATIENCE_S) as answer:
            return dict(json.load(answer))
    except urllib.error.HTTPError as error:
        raise NotJoined(f"The console refused: {_text_of(error)}") from error
    except (urllib.error.URLError, ValueError) as error:
        reason = getattr(error, "reason", error)
        hint = ""
        if isinstance(reason, ssl.SSLCertVerificationError):
            hint = " With a certificate of your own authority: FLEET_JOIN_CA=/its.crt before the command, after sudo."
        raise NotJoined(f"{address} cannot be used: {reason}.{hint}") from error


class NoRedirects(urllib.request.HTTPRedirectHandler):
    """Follow no redirect: it could lead away from TLS."""

    def redirect_request(self, *_: object) -> None:
        """Return no new request, so that the answer is an error."""


def _text_of(error: urllib.error.HTTPError) -> str:
    try:
        return str(json.load(error)["text"])
    except (ValueError, KeyError, TypeError):
        return f"{error.code} {error.reason}"


if __name__ == "__main__":
    sys.exit(main())
