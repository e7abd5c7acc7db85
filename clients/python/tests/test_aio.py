"""The asyncio client against a real server: what differs from the other one, which is made from it."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from conftest import BALL, CAMERA

import palpate
from palpate import aio
from palpate.candidates import Candidate


class Arm:
    """The ball again, as a robot whose motions take time."""

    async def touch(self, candidate: Candidate) -> palpate.Outcome:
        await asyncio.sleep(0.001)
        return BALL.touch(candidate)


async def begun(client: aio.Client) -> aio.Session:
    session = await client.create_session(frame_id="base", table_z=0.06)
    await session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
    return session


def test_a_ball_is_explored(server: palpate.LocalServer, tmp_path: Path) -> None:
    async def run() -> None:
        async with aio.Client(server.url) as client:
            session = await begun(client)
            explored = await aio.explore(Arm(), session, 12, robot_id="arm")
            assert (explored.attempts, session.stats.attempts) == (12, 12)
            mesh = await session.mesh()
            assert BALL.error_m(mesh.vertices) < 5e-4
            assert [event.seq async for event in session.events()] == list(range(1, 15))
            await session.export(tmp_path / "ball.tar")
            await session.delete()
            back = await client.import_session(tmp_path / "ball.tar")
            assert back.id == session.id
            assert back.id in [one.id async for one in client.sessions()]
            fork = await back.fork(5)
            assert fork.revision == 5
            with pytest.raises(palpate.Refused, match="top_k"):
                await fork.candidates(10_000)

    asyncio.run(run())


def test_a_session_is_iterated_and_watched_at_once(server: palpate.LocalServer) -> None:
    async def follow(session: aio.Session, end: int) -> list[int]:
        seen = []
        async for update in session.watch(0):
            if update.event:
                seen.append(update.event.seq)
            if seen[-1:] == [end]:
                return seen
        return seen

    async def run() -> None:
        async with aio.Client(server.url) as client:
            session = await begun(client)
            following = asyncio.create_task(follow(await client.session(session.id), 6))
            async for candidate in session:
                await session.report(candidate, await Arm().touch(candidate))
                if session.stats.attempts == 4:
                    break
            assert await asyncio.wait_for(following, 20) == [1, 2, 3, 4, 5, 6]

    asyncio.run(run())


def test_many_sessions_share_one_connection(server: palpate.LocalServer) -> None:
    async def run() -> None:
        async with aio.Client(server.url) as client:
            sessions = await asyncio.gather(*(begun(client) for _ in range(6)))
            explored = await asyncio.gather(*(aio.explore(Arm(), session, 3) for session in sessions))
            assert [one.attempts for one in explored] == [3] * 6
            assert len({session.id for session in sessions}) == 6

    asyncio.run(run())


def test_a_server_that_is_not_there_is_said_in_words() -> None:
    async def run() -> None:
        async with aio.Client("http://127.0.0.1:9", connect_timeout=0.5):
            pass

    with pytest.raises(palpate.NoServer, match="is one running there"):
        asyncio.run(run())
