# Made by generate.py from aio/exploration.py: change that.
"""The whole loop, for anything that has a `touch` method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from palpate.session import Session
from palpate.candidates import Candidate, ContactAccepted
from palpate.outcomes import Outcome


class Robot(Protocol):
    """What `explore` needs of a robot."""

    def touch(self, candidate: Candidate) -> Outcome:
        """Moves the pad from `candidate.start` towards `candidate.end` and tells what came of it."""
        ...


@dataclass(frozen=True)
class Step:
    """One attempt of a loop."""

    number: int
    candidate: Candidate
    outcome: Outcome
    accepted: ContactAccepted


@dataclass(frozen=True)
class Explored:
    """How a loop ended.

    Attributes:
        attempts: how many it made.
        stop_reason: the server's advice to stop; `None` where `attempts` of the call ended it.
    """

    attempts: int
    stop_reason: str | None


def explore(
    robot: Robot,
    session: Session,
    attempts: int | None = None,
    *,
    robot_id: str = "",
    on_step: Callable[[Step], None] | None = None,
) -> Explored:
    """Touches until the server advises to stop, has no candidate, or `attempts` are made.

    A server that is killed meanwhile is waited for, as long as the client's timeout: nothing is lost or counted twice.
    An exception of the robot ends the loop; the session stays as it is, and a new loop goes on with it.

    Args:
        robot: anything with a `touch(candidate)` that returns an outcome.
        session: with at least one view.
        attempts: at most so many.
        robot_id: who touches.
        on_step: called after each attempt, for progress and pictures.
    """
    made = 0
    proposal = session.candidates(robot_id=robot_id)
    candidate, stop = (proposal[0] if len(proposal) else None), proposal.stop_reason
    while candidate is not None and stop is None and (attempts is None or made < attempts):
        outcome = robot.touch(candidate)
        accepted = session.report(candidate, outcome, robot_id=robot_id)
        made += 1
        if on_step:
            on_step(Step(made, candidate, outcome, accepted))
        candidate, stop = (accepted[0] if len(accepted) else None), accepted.stop_reason
    return Explored(made, stop)
