"""The console's link authority: it signs the certificates of bridge hosts, and web processes trust them.

Its key is derived from FLEET_SECRET_KEY, which all web processes have: nothing to keep, to copy or to back up. With a
new secret key bridge hosts join again.
"""

from __future__ import annotations

import datetime
import hashlib
import ipaddress
import shutil
import tempfile
from functools import lru_cache
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.kdf.hkdf import HKDF
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from django.conf import settings

ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551  # of the curve P-256
NAME = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "fleet console, links to bridges")])
BEGIN = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
END = datetime.datetime(2126, 1, 1, tzinfo=datetime.UTC)
CERTIFICATE_LASTS = datetime.timedelta(days=3650)  # a new FLEET_LINK_SECRET shuts out a host that has left
HOUR = datetime.timedelta(hours=1)  # a clock may be behind


def authority_pem() -> str:
    """Return the authority's certificate, which web processes trust."""
    return _pem(_authority(settings.SECRET_KEY)[0])


def sign(request_pem: bytes, host: str, now: datetime.datetime) -> tuple[str, datetime.datetime]:
    """Return a certificate for the key of this request and for this host, and its end.

    Raises `ValueError` if it is no signed request. Names in the request do not count.
    """
    request = x509.load_pem_x509_csr(request_pem)
    key = request.public_key()
    if not request.is_signature_valid or not isinstance(key, ec.EllipticCurvePublicKey):
        raise ValueError("not a signed request of an elliptic curve key")
    authority, authority_key = _authority(settings.SECRET_KEY)
    until = now + CERTIFICATE_LASTS
    certificate = (
        _builder(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, host[:64])]), key, now - HOUR, until)
        .add_extension(x509.SubjectAlternativeName([_general_name(host)]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.public_key()),  # type: ignore[arg-type]
            critical=False,
        )
        .sign(authority_key, hashes.SHA256())
    )
    return _pem(certificate), until


def of_other_console() -> bool:
    """Return whether a console with another secret key signed FLEET_LINK_CERT: here its like are not trusted."""
    try:
        certificate = x509.load_pem_x509_certificate(Path(settings.FLEET_LINK_CERT or "").read_bytes())
        certificate.verify_directly_issued_by(_authority(settings.SECRET_KEY)[0])
    except InvalidSignature:
        return True
    except (OSError, ValueError, TypeError):  # ValueError: an authority of their own, by its name
        return False
    return False


def own_files(folder: Path, host: str) -> tuple[str, str]:
    """Return the files with this computer's certificate and key; the first call makes them in `folder`."""
    name = hashlib.sha256(f"{host}\n{authority_pem()}".encode()).hexdigest()[:12]
    place = folder / f"link-{name}"
    if not place.exists():
        key = ec.generate_private_key(ec.SECP256R1())
        request = (
            x509.CertificateSigningRequestBuilder().subject_name(x509.Name([])).sign(key, hashes.SHA256())
        )
        pem = request.public_bytes(serialization.Encoding.PEM)
        certificate, _ = sign(pem, host, datetime.datetime.now(datetime.UTC))
        draft = Path(tempfile.mkdtemp(prefix="link-", dir=folder))  # its owner alone may open it
        (draft / "certificate.pem").write_text(certificate)
        (draft / "key.pem").write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
        )
        try:
            draft.rename(place)
        except OSError:  # another process was quicker
            shutil.rmtree(draft)
    return str(place / "certificate.pem"), str(place / "key.pem")


@lru_cache(maxsize=1)
def _authority(secret_key: str) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    drawn = HKDF(hashes.SHA256(), length=48, salt=None, info=b"fleet link authority").derive(
        secret_key.encode()
    )
    key = ec.derive_private_key(int.from_bytes(drawn) % (ORDER - 1) + 1, ec.SECP256R1())
    certificate = (
        _builder(NAME, key.public_key(), BEGIN, END)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_signs_certificates(), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    return certificate, key


def _builder(
    name: x509.Name, key: ec.EllipticCurvePublicKey, begin: datetime.datetime, end: datetime.datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(NAME)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(end)
    )


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _signs_certificates() -> x509.KeyUsage:
    allowed = {"key_cert_sign", "crl_sign"}
    names = (
        *(
            "digital_signature",
            "content_commitment",
            "key_encipherment",
            "data_encipherment",
            "key_agreement",
        ),
        *("key_cert_sign", "crl_sign", "encipher_only", "decipher_only"),
    )
    return x509.KeyUsage(**{name: name in allowed for name in names})


def _pem(certificate: x509.Certificate) -> str:
    return certificate.public_bytes(serialization.Encoding.PEM).decode()
