"""A private certificate authority for hosts, and what is wrong with a certificate.

Needs the library `cryptography`, an extra: `pip install lodeline[tls]`. In the folder are `ca.pem`
and, where hosts are added, its key `ca.key`; for each host `HOST.pem` and `HOST.key`.
"""

from __future__ import annotations

import datetime
import ipaddress
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

CA = "ca"
YEARS = 10
DAYS = 365
WARN_DAYS = 14
LEEWAY = datetime.timedelta(days=1)
"""A certificate is valid from a day before it was made: clocks of robots are not exact."""


class KeysError(RuntimeError):
    """A key or certificate is missing or does not fit."""


def init(folder: Path) -> str:
    """Make a new authority; its fingerprint. KeysError if there is one."""
    from cryptography import x509

    if (folder / f"{CA}.pem").exists():
        raise KeysError(f"{folder} has an authority already")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    key = _new_key()
    name = _name("lodeline fleet")
    builder = _builder(name, name, key, DAYS * YEARS).add_extension(
        x509.BasicConstraints(ca=True, path_length=0), critical=True
    )
    certificate = _signed(builder, key)
    _write(folder, CA, key, certificate)
    return _fingerprint(certificate)


def add(folder: Path, host: str, addresses: Sequence[str] = (), days: float = DAYS) -> str:
    """Make a key and a certificate for a host, known by its name and these addresses; the
    certificate's fingerprint. KeysError without the authority's key.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    if host == CA:
        raise KeysError(f"no host can be called {CA!r}")
    authority = read(folder / f"{CA}.pem")
    try:
        loaded = load_pem_private_key((folder / f"{CA}.key").read_bytes(), None)
    except OSError as error:
        text = f"{folder / CA}.key: {error.strerror}: hosts are added where it is kept"
        raise KeysError(text) from None
    names: list[x509.GeneralName] = [x509.DNSName(host)]
    names += [_general_name(address) for address in addresses]
    key = _new_key()
    builder = (
        _builder(_name(host), authority.subject, key, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(
            x509.ExtendedKeyUsage(
                [
                    x509.oid.ExtendedKeyUsageOID.SERVER_AUTH,
                    x509.oid.ExtendedKeyUsageOID.CLIENT_AUTH,
                ]
            ),
            critical=False,
        )
    )
    certificate = _signed(builder, loaded)  # type: ignore[arg-type]
    _write(folder, host, key, certificate)
    return _fingerprint(certificate)


def check(folder: Path, host: str, address: str | None = None) -> list[str]:
    """Warnings on the keys of a host; KeysError names the file and what is wrong with it.

    `address` is the one that the host listens on.
    """
    from cryptography import x509

    authority, own = read(folder / f"{CA}.pem"), read(folder / f"{host}.pem")
    if not (folder / f"{host}.key").exists():
        raise KeysError(f"{folder / host}.key is missing: run `lodeline keys add {host}`")
    file = folder / f"{host}.pem"
    try:
        own.verify_directly_issued_by(authority)
    except Exception as error:
        raise KeysError(f"TLS {file} was not made by the authority in {CA}.pem") from error
    if (name := _common_name(own)) != host:
        raise KeysError(f"TLS {file} is of host {name!r}: run `lodeline keys add {host}`")
    now = _now()
    for certificate, name in ((authority, f"{CA}.pem"), (own, file.name)):
        if now > (end := certificate.not_valid_after_utc):
            raise KeysError(f"TLS {name} expired {end:%Y-%m-%d}: run `lodeline keys add {host}`")
        if now < (begin := certificate.not_valid_before_utc):
            raise KeysError(
                f"TLS {name} is valid from {begin:%Y-%m-%d}, and here it is {now:%Y-%m-%d}: "
                "is the clock of this host wrong?"
            )
    names = own.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    if address is not None and _general_name(address) not in list(names):
        raise KeysError(
            f"TLS {file.name} is not for {address}: run `lodeline keys add {host} {address}`"
        )
    left = (own.not_valid_after_utc - now).days
    return [f"TLS {file.name} expires in {left} days"] if left < WARN_DAYS else []


def read(file: Path) -> x509.Certificate:
    """A certificate; KeysError with the command that makes one."""
    try:
        from cryptography import x509
    except ImportError:
        text = "tls needs the library cryptography: pip install 'lodeline[tls]'"
        raise KeysError(text) from None
    try:
        return x509.load_pem_x509_certificate(file.read_bytes())
    except OSError as error:
        verb = "init" if file.stem == CA else f"add {file.stem}"
        raise KeysError(f"TLS {file}: {error.strerror}: run `lodeline keys {verb}`") from None
    except ValueError:
        raise KeysError(f"TLS {file} is no certificate") from None


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def _new_key() -> EllipticCurvePrivateKey:
    from cryptography.hazmat.primitives.asymmetric import ec

    return ec.generate_private_key(ec.SECP256R1())


def _name(text: str) -> x509.Name:
    from cryptography import x509

    return x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, text)])


def _common_name(certificate: x509.Certificate) -> str:
    from cryptography import x509

    names = certificate.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def _general_name(address: str) -> x509.GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(address.strip("[]")))
    except ValueError:
        return x509.DNSName(address)


def _builder(
    subject: x509.Name, issuer: x509.Name, key: EllipticCurvePrivateKey, days: float
) -> x509.CertificateBuilder:
    from cryptography import x509

    now = _now()
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - LEEWAY)
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _signed(builder: x509.CertificateBuilder, key: EllipticCurvePrivateKey) -> x509.Certificate:
    from cryptography.hazmat.primitives import hashes

    return builder.sign(key, hashes.SHA256())


def _write(
    folder: Path, name: str, key: EllipticCurvePrivateKey, certificate: x509.Certificate
) -> None:
    from cryptography.hazmat.primitives import serialization

    secret = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    (folder / f"{name}.key").unlink(missing_ok=True)
    with os.fdopen(
        os.open(folder / f"{name}.key", os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb"
    ) as file:
        file.write(secret)
    (folder / f"{name}.pem").write_bytes(certificate.public_bytes(serialization.Encoding.PEM))


def _fingerprint(certificate: x509.Certificate) -> str:
    from cryptography.hazmat.primitives import hashes

    return certificate.fingerprint(hashes.SHA256()).hex(":")
