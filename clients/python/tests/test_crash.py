"""A server that is killed and comes back in the middle of it: nothing is lost, and nothing is counted twice."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import BALL, CAMERA

import palpate
from palpate import aio
from palpate.candidates import Candidate

ATTEMPTS = 15


class Mortal:
    """A server on one port with one database, through kills and restarts."""

    def __init__(self, folder: Path):
        self._database = folder / "palpate.db"
        self.server = palpate.local_server(database=self._database)
        self.url = self.server.url
        self._port = int(self.url.rpartition(":")[2])

    def kill_and_restart_soon(self) -> None:
        """Kills it now; it is back after half a second."""
        self.server.kill()
        threading.Timer(0.5, self.restart).start()

    def restart(self) -> None:
        self.server = palpate.local_server(database=self._database, port=self._port)


@pytest.fixture
def mortal(tmp_path: Path) -> Iterator[Mortal]:
    mortal = Mortal(tmp_path)
    yield mortal
    mortal.server.stop()


class Saboteur:
    """A robot in whose hands the server dies at some of the touches."""

    def __init__(self, mortal: Mortal, deaths: tuple[int, ...]):
        self._mortal, self._deaths, self.touches = mortal, deaths, 0

    def touch(self, candidate: Candidate) -> palpate.Outcome:
        self.touches += 1
        if self.touches in self._deaths:
            self._mortal.kill_and_restart_soon()
        return BALL.touch(candidate)


class AsyncSaboteur(Saboteur):
    async def touch(self, candidate: Candidate) -> palpate.Outcome:  # type: ignore[override]
        return super().touch(candidate)


def check(events: list[palpate.v1.Event], robot: Saboteur) -> None:
    """Every touch that the robot made is in the log, once."""
    reported = [event.request_id for event in events if event.HasField("contact_result")]
    assert len(reported) == len(set(reported)) == robot.touches == ATTEMPTS


def test_explore_goes_on(mortal: Mortal) -> None:
    with palpate.Client(mortal.url) as client:
        session = client.create_session(table_z=0.06)
        session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
        robot = Saboteur(mortal, deaths=(4, 9))
        palpate.explore(robot, session, ATTEMPTS)
        check(list(session.events()), robot)
        assert BALL.error_m(session.mesh().vertices) < 5e-4


def test_explore_goes_on_with_asyncio(mortal: Mortal) -> None:
    async def run() -> None:
        async with aio.Client(mortal.url) as client:
            session = await client.create_session(table_z=0.06)
            await session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
            robot = AsyncSaboteur(mortal, deaths=(4, 9))
            await aio.explore(robot, session, ATTEMPTS)
            check([event async for event in session.events()], robot)

    asyncio.run(run())


def test_a_kill_at_any_moment_counts_nothing_twice(mortal: Mortal) -> None:
    """The server dies at times that have nothing to do with what it does, within a report as well."""
    is_over = threading.Event()

    def killer() -> None:
        for wait in (0.11, 0.43, 0.07, 0.29):
            if is_over.wait(wait):
                return
            mortal.server.kill()
            time.sleep(0.1)
            mortal.restart()

    with palpate.Client(mortal.url) as client:
        session = client.create_session(table_z=0.06)
        session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
        robot = Saboteur(mortal, deaths=())
        thread = threading.Thread(target=killer)
        thread.start()
        try:
            palpate.explore(robot, session, ATTEMPTS)
        finally:
            is_over.set()
            thread.join()
        check(list(session.events()), robot)


def test_a_watch_goes_on_after_the_last_event(mortal: Mortal) -> None:
    with palpate.Client(mortal.url) as client:
        session = client.create_session(table_z=0.06)
        session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
        seen: list[int] = []
        for update in client.session(session.id).watch(0):
            if update.event is None:
                continue
            seen.append(update.event.seq)
            if seen[-1] in (3, 5):
                mortal.server.kill()
                mortal.restart()
            if seen[-1] == 7:
                break
            if seen[-1] >= 2:
                candidate = session.candidates()[0]
                session.report(candidate, BALL.touch(candidate))
        assert seen == list(range(1, 8))


def test_a_server_that_stays_away_is_given_up(mortal: Mortal) -> None:
    with palpate.Client(mortal.url, timeout=1.0) as client:
        session = client.create_session()
        mortal.server.kill()
        began = time.monotonic()
        with pytest.raises(palpate.NoAnswer, match="did not answer in .* attempts"):
            session.refresh()
        assert time.monotonic() - began < 3
