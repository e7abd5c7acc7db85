"""A real server, which PALPATE_BINARY or the path names, and a session on it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import palpate
from palpate.simulated import Ball

CAMERA = (0.5, 0.0, 0.6)
BALL = Ball(center=(0.5, 0.0, 0.1), radius=0.04)


@pytest.fixture(scope="session")
def server() -> Iterator[palpate.LocalServer]:
    with palpate.local_server() as server:
        yield server


@pytest.fixture
def client(server: palpate.LocalServer) -> Iterator[palpate.Client]:
    with palpate.Client(server.url) as client:
        yield client


@pytest.fixture
def session(client: palpate.Client) -> palpate.Session:
    """A session that has seen the top of a ball."""
    session = client.create_session(frame_id="base", table_z=0.06)
    session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
    return session
