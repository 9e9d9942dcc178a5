"""Parts of X.509 certificates that URC's certificate authorities share.

Layer 1. Only `cryptography` builds, signs and verifies certificates.
"""

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

__all__ = ["common_name", "is_signed_by", "key_pem", "key_usage"]

_LONGEST_NAME = 64
"""Maximum length of a common name, in characters (RFC 5280, ub-common-name)."""


def common_name(name: str) -> x509.Name:
    """Return a subject with this common name, truncated to 64 characters."""
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:_LONGEST_NAME])])


def is_signed_by(certificate: x509.Certificate, issuer: x509.Certificate) -> bool:
    """Return whether the issuer's key has signed the certificate, and the issuer's name matches."""
    try:
        certificate.verify_directly_issued_by(issuer)
    except Exception:  # `cryptography` raises several classes for damaged certificates
        return False
    return True


def key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    """Return a private key in PEM (PKCS #8), without a passphrase."""
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def key_usage(*, is_authority: bool) -> x509.KeyUsage:
    """Return the key usage of an authority or of a TLS certificate (RFC 5280, 4.2.1.3)."""
    return x509.KeyUsage(
        digital_signature=not is_authority, key_cert_sign=is_authority, crl_sign=is_authority,
        content_commitment=False, key_encipherment=False, data_encipherment=False,
        key_agreement=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip
