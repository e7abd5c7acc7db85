"""Who calls, and whom they trust: a token, a certificate, the authority of the server's certificate."""

from __future__ import annotations

import ipaddress
import os
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias
from urllib.parse import urlsplit

import grpc

#: The path of a PEM file, or what is in one.
Pem: TypeAlias = "str | Path | bytes"


@dataclass(frozen=True)
class Access:
    """What a connection shows and trusts; nothing of it is ever printed."""

    #: Sent along with each call.
    metadata: tuple[tuple[str, str], ...] = field(repr=False)
    #: Of an encrypted connection; None for one in the clear.
    credentials: grpc.ChannelCredentials | None = field(repr=False)


def access(url: str, token: str | None, ca: Pem | None, certificate: Pem | None, key: Pem | None) -> Access:
    """What to show and trust at this address, from what is given or else from the environment.

    Raises:
        ValueError: something of it cannot be used.
        OSError: a file cannot be read.
    """
    is_encrypted = urlsplit(url).scheme == "https"
    token = _token(token)
    # A shell that is set up for a lab's server still calls others in the clear.
    if is_encrypted:
        ca = ca or os.environ.get("PALPATE_CA")
        if certificate is None and key is None:
            certificate, key = os.environ.get("PALPATE_CERTIFICATE"), os.environ.get("PALPATE_KEY")
    if (certificate is None) != (key is None):
        raise ValueError("certificate and key belong together: give both")
    metadata = (("authorization", f"Bearer {token}"),) if token else ()
    if not is_encrypted:
        if ca is not None or certificate is not None:
            raise ValueError(f"{url}: ca, certificate and key are for https://, and this address is not")
        if token and not _is_this_machine(url):
            warnings.warn(
                f"the token goes to {url} in the clear: let the server speak TLS (--tls-cert) and write https://",
                stacklevel=3,
            )
        return Access(metadata, None)
    pair = (_pem(certificate, "certificate"), _pem(key, "key")) if certificate and key else (None, None)
    credentials = grpc.ssl_channel_credentials(
        root_certificates=_pem(ca, "ca") if ca else None, private_key=pair[1], certificate_chain=pair[0]
    )
    return Access(metadata, credentials)


def _token(token: str | None) -> str:
    if token is None:
        file = os.environ.get("PALPATE_TOKEN_FILE")
        token = Path(file).read_text() if file else os.environ.get("PALPATE_TOKEN", "")
    token = token.strip()
    if not all("!" <= letter <= "~" for letter in token):
        raise ValueError("the token is none: it is one word, as `palpate token create` prints it")
    return token


def _pem(pem: Pem, name: str) -> bytes:
    if isinstance(pem, bytes):
        return pem
    if isinstance(pem, str) and "-----BEGIN" in pem:
        return pem.encode()
    try:
        content = Path(pem).read_bytes()
    except OSError as error:
        # What was taken for the path of a key may be the key.
        shown = "" if name == "key" else f" {pem}"
        raise type(error)(
            f"{name}:{shown} is no file that can be read, and no text of one ({error.strerror})"
        ) from None
    if b"-----BEGIN" not in content:
        raise ValueError(f"{name}: {pem} is no PEM file")
    return content


def _is_this_machine(url: str) -> bool:
    host = urlsplit(url if "//" in url else f"http://{url}").hostname or ""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
