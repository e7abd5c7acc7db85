"""Where the server is, and how the connection to it behaves."""

from __future__ import annotations

from urllib.parse import urlsplit

import grpc
import grpc.aio

#: A mesh of the finest tessellation fits with room to spare.
MAX_REPLY_BYTES = 64 * 1024 * 1024

OPTIONS: list[tuple[str, int]] = [
    ("grpc.max_receive_message_length", MAX_REPLY_BYTES),
    ("grpc.max_send_message_length", -1),  # the server has its own limit, and names it
    ("grpc.enable_retries", 0),  # retry.py does
    # A server that was killed is found again as soon as it is back, not after two minutes.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.min_reconnect_backoff_ms", 2000),  # what a connection may take to be made
    ("grpc.max_reconnect_backoff_ms", 1000),
    # A connection that hangs, such as over a cable that was pulled, is noticed within 25 s.
    ("grpc.keepalive_time_ms", 15_000),
    ("grpc.keepalive_timeout_ms", 10_000),
    ("grpc.http2.max_pings_without_data", 0),
    # A connection that is made anew begins anew, without the waits of the one before.
    ("grpc.use_local_subchannel_pool", 1),
    # Robots are called directly, whatever proxy the machine has for the web.
    ("grpc.enable_http_proxy", 0),
]


def target(url: str) -> str:
    """The address that gRPC connects to for `url`.

    Raises:
        ValueError: it is no address of a server.
    """
    parts = urlsplit(url if "//" in url else f"http://{url}")
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if parts.scheme not in ("http", "https") or not host or parts.path not in ("", "/") or parts.query:
        raise ValueError(f"{url!r} is not the address of a server; one looks like http://127.0.0.1:7257")
    port = port or (443 if parts.scheme == "https" else 80)
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def connect(target: str, credentials: grpc.ChannelCredentials | None) -> grpc.Channel:
    """A connection that is made when it is needed first; in the clear without `credentials`."""
    if credentials is None:
        return grpc.insecure_channel(target, OPTIONS)
    return grpc.secure_channel(target, credentials, OPTIONS)


def connect_aio(target: str, credentials: grpc.ChannelCredentials | None) -> grpc.aio.Channel:
    """The same for asyncio."""
    if credentials is None:
        return grpc.aio.insecure_channel(target, OPTIONS)
    return grpc.aio.secure_channel(target, credentials, OPTIONS)
