"""What the examples share: the address of the server on the command line, or a server of one's own."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

import palpate


@contextmanager
def client(description: str) -> Iterator[palpate.Client]:
    """A client of the server that the command line names."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("url", nargs="?", default="http://127.0.0.1:7257", help="of the server (default: %(default)s)")
    parser.add_argument("--local", action="store_true", help="start a server, with a database to throw away")
    chosen = parser.parse_args()
    if chosen.local:
        with palpate.local_server() as server, palpate.Client(server.url) as connected:
            yield connected
    else:
        with palpate.Client(chosen.url) as connected:
            yield connected
