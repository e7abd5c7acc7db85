"""Where to touch next, and what the server answers to evidence."""

from __future__ import annotations

import sys
import warnings as python_warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np

from palpate import v1
from palpate.errors import EvidenceWarning
from palpate.poses import Array, from_pose, from_vector


@dataclass(frozen=True, eq=False)
class Candidate:
    """A proposed touch. Positions are metres, in the session's frame.

    A robot moves the pad's centre from `start` towards `end`, turned as in `pad_pose`, and stops when it feels a force.
    """

    #: Names it in a report.
    id: str
    #: (3,) where the surface is expected, and its outward unit normal there.
    point: Array
    normal: Array
    #: (3,) where the approach starts and where it gives up: point ± d · normal.
    start: Array
    end: Array
    #: (4, 4) pose of the tool, and of the pad itself (z out of the pad), at `start`.
    tool_pose: Array
    pad_pose: Array
    #: Which pad to touch with; "" where the session declares none.
    sensor_id: str
    #: Of the surface there, in [0, 1], and its standard deviation along the normal in metres, 0 where it is not estimated.
    uncertainty: float
    std_m: float
    #: Predicted probability that the approach fails, in [0, 1].
    failure_risk: float
    #: The higher, the sooner; the sum of its terms, each weight times value.
    score: float
    terms: dict[str, float]
    #: The choice in one sentence.
    why: str
    #: Whether the thresholds were relaxed to find it.
    relaxed: bool
    #: The whole message.
    message: v1.Candidate = field(repr=False)

    @staticmethod
    def read(message: v1.Candidate, sensors: Iterable[v1.Sensor]) -> Candidate:
        """A candidate from its message; `sensors` are those of the session's configuration."""
        tool_pose = from_pose(message.tool_pose)
        pads = [from_pose(sensor.tool_from_sensor) for sensor in sensors if sensor.id == message.sensor_id]
        return Candidate(
            id=message.candidate_id,
            point=from_vector(message.point),
            normal=from_vector(message.normal),
            start=from_vector(message.probe_start),
            end=from_vector(message.probe_end),
            tool_pose=tool_pose,
            pad_pose=tool_pose @ pads[0] if pads else tool_pose,
            sensor_id=message.sensor_id,
            uncertainty=message.uncertainty,
            std_m=message.std_m,
            failure_risk=message.failure_risk,
            score=message.score,
            terms={term.term: term.weight * term.value for term in message.terms},
            why=message.why,
            relaxed=message.relaxed,
            message=message,
        )


@dataclass(frozen=True, eq=False)
class Candidates(Sequence[Candidate]):
    """The best places to touch, best first; empty where there is none, and then `stop_reason` says why.

    Attributes:
        stop_reason: the server's advice to stop, for instance STOP_REASON_COVERAGE; `None` = go on.
        warnings: what the server noticed; they are issued as Python warnings too.
    """

    candidates: tuple[Candidate, ...]
    revision: int
    stop_reason: str | None
    warnings: tuple[EvidenceWarning, ...]

    def __len__(self) -> int:
        return len(self.candidates)

    @overload
    def __getitem__(self, index: int) -> Candidate: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Candidate]: ...
    def __getitem__(self, index: int | slice) -> Candidate | Sequence[Candidate]:
        return self.candidates[index]

    def __iter__(self) -> Iterator[Candidate]:
        return iter(self.candidates)


@dataclass(frozen=True, eq=False)
class Proposal(Candidates):
    """The answer to `candidates`.

    Attributes:
        excluded: how many places were not proposed, by why.
    """

    excluded: dict[str, int]


@dataclass(frozen=True, eq=False)
class ViewAccepted(Candidates):
    """The answer to a view, with the first candidates.

    Attributes:
        accepted_points, dropped_points: how many entered the estimate, and how many were thinned away.
        set_aside: how many were not taken for the object, by why: the table, repeats, pixels at a depth edge.
        voxel_m: edge of the voxels by which the view was thinned, in metres; 0 = not thinned.
    """

    accepted_points: int
    dropped_points: int
    set_aside: dict[str, int]
    voxel_m: float


@dataclass(frozen=True, eq=False)
class ContactAccepted(Candidates):
    """The answer to a report, with the next candidates. What it reports is on the server's disk.

    Attributes:
        seq: number of the event in the session's log, for `retract`.
        duplicate: whether the server knew this request_id: the report was counted before, and only once.
        uncertainty: that the contact was given, in [0, 1].
        touched_points: (contacts, 3) what was taken as touched, in metres.
        max_vertex_move_m: the largest distance by which the estimate moved, in metres.
    """

    seq: int
    duplicate: bool
    uncertainty: float
    touched_points: Array
    max_vertex_move_m: float


def stop_reason(value: v1.StopReason) -> str | None:
    """The name of an advice to stop."""
    return v1.StopReason.Name(value) if value else None


def read_warnings(messages: Iterable[v1.Warning]) -> tuple[EvidenceWarning, ...]:
    """Warnings from their messages."""
    return tuple(
        EvidenceWarning(message.message, v1.WarningCode.Name(message.code), dict(message.parameters))
        for message in messages
    )


def issue(warnings: Iterable[EvidenceWarning]) -> None:
    """Issues `warnings` as Python warnings, so that none goes unseen, at the line that called this package."""
    frame, stacklevel = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("palpate."):
        frame, stacklevel = frame.f_back, stacklevel + 1
    for warning in warnings:
        python_warnings.warn(warning, stacklevel=stacklevel)


def counts(message: v1.Excluded | v1.SetAside) -> dict[str, int]:
    """The fields of `message` that are counts and not 0."""
    return {field.name: value for field, value in message.ListFields() if isinstance(value, int)}


def points(messages: Iterable[v1.Vector3]) -> Array:
    """Messages as an array (n, 3)."""
    return np.array([from_vector(message) for message in messages]).reshape(-1, 3)
