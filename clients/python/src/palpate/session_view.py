"""What a session object knows without asking."""

from __future__ import annotations

from palpate import v1
from palpate.candidates import Candidates, stop_reason


class SessionView:
    """A session as it was in the last reply that brought it; both kinds of sessions are one."""

    def __init__(self, info: v1.Session):
        self._info = info

    @property
    def id(self) -> str:
        """Names the session on its server."""
        return self._info.session_id

    @property
    def info(self) -> v1.Session:
        """The whole message: names, labels, configuration, state and figures."""
        return self._info

    @property
    def revision(self) -> int:
        """Number of the last event in its log."""
        return self._info.revision

    @property
    def stats(self) -> v1.SessionStats:
        """Its figures: attempts, failures, mean_uncertainty, mean_std_m, ..."""
        return self._info.stats

    @property
    def stop_reason(self) -> str | None:
        """The server's advice to stop, for instance STOP_REASON_COVERAGE; `None` = go on."""
        return stop_reason(self._info.should_stop)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} at revision {self.revision}>"


class NotReported(RuntimeError):
    """A loop asked for the next candidate before it said what came of the last one."""


def next_candidate(proposal: Candidates, last_revision: int | None) -> bool:
    """Whether a loop over candidates goes on with the first of `proposal`.

    Raises:
        NotReported: nothing was reported since `last_revision`, at which the loop got the candidate before.
    """
    if last_revision is not None and proposal.revision <= last_revision:
        raise NotReported(
            "nothing was reported of the last candidate, so that it would come again: call contact, no_contact, "
            "invalid_contact or reject for each candidate"
        )
    return bool(len(proposal)) and proposal.stop_reason is None
