"""The same client for asyncio: `async with palpate.aio.Client(url) as client: ...`, every call with `await`.

A robot's `touch` is a coroutine here; `asyncio.to_thread` makes one of a function that waits.
"""

from palpate.aio.client import Client
from palpate.aio.exploration import Explored, Robot, Step, explore
from palpate.aio.session import Session

__all__ = ["Client", "Explored", "Robot", "Session", "Step", "explore"]
