"""When a call is tried again, and after which wait.

A call is sent again only where the server may take it later without any change, with the bytes of its first attempt and
so with the same `request_id`: the server counts it once.
Waits double from one attempt to the next and are spread at random, so that robots that lost one server do not come back
in step; a longer wait that the server asks for is kept.
"""

from __future__ import annotations

import random
import time
import uuid

from palpate.errors import PalpateError, Refused

FIRST_WAIT = 0.1  # s
LONGEST_WAIT = 2.0  # s


class Attempts:
    """The attempts of one call, which has `timeout` seconds in all."""

    def __init__(self, timeout: float):
        self._end = time.monotonic() + timeout
        #: Number of the attempt that runs, from 1.
        self.number = 1

    def time_left(self) -> float:
        """Seconds that the attempt has."""
        return max(self._end - time.monotonic(), 0.001)

    def wait_after(self, error: PalpateError) -> float:
        """Seconds to wait before the next attempt.

        Raises:
            PalpateError: `error` itself, where there is to be no other attempt.
        """
        if not error.is_transient():
            raise error
        backoff = min(FIRST_WAIT * 2.0 ** (self.number - 1), LONGEST_WAIT)
        asked = (error.retry_after or 0.0) if isinstance(error, Refused) else 0.0
        wait = max(backoff * random.uniform(0.5, 1.0), asked)
        if time.monotonic() + wait >= self._end:
            raise error
        self.number += 1
        return wait


def new_request_id() -> str:
    """A value that no other call has."""
    return str(uuid.uuid4())
