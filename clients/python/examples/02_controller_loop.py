#!/usr/bin/env python3
"""A controller's loop with all that happens to one: misses, places out of reach, a touch by the housing, and a server
that goes away and comes back, for which nothing has to be done.
"""

from __future__ import annotations

import warnings

import numpy as np
from common import client

import palpate
from palpate.simulated import Ball

CAMERA = (0.5, 0.0, 0.6)


class Arm:
    """A stand-in for an arm over a ball. A real one has the same method."""

    def __init__(self) -> None:
        self._ball = Ball()
        self._random = np.random.default_rng(1)

    def touch(self, candidate: palpate.Candidate) -> palpate.Outcome:
        if candidate.start[0] > 0.55:
            return palpate.Rejected("NO_IK", "behind the object, as seen from the base")
        if self._random.random() < 0.05:
            return palpate.InvalidContact(candidate.pad_pose, "the housing touched")
        touched = self._ball.probe(candidate.start, candidate.end)
        if touched is None:
            return palpate.NoContact()  # on the whole way from candidate.start to candidate.end
        pose = candidate.pad_pose.copy()
        pose[:3, 3] = touched
        # What the tared sensor shows, in its own frame: the object pushes the pad back, against its z axis.
        force = self._random.normal([0.0, 0.0, -2.0], 0.02)
        return palpate.Contact(pose, force, torque=self._random.normal(0.0, 1e-4, 3))


def tell(step: palpate.Step) -> None:
    """One line for each attempt."""
    x, y, z = 1000 * step.candidate.point
    outcome, moved = type(step.outcome).__name__, 1000 * step.accepted.max_vertex_move_m
    print(f"{step.number:3} at {x:6.1f} {y:6.1f} {z:6.1f} mm: {outcome:14} moved the surface by up to {moved:4.1f} mm")


with client(__doc__) as server:
    # Doubts of the server are Python warnings; each is in `accepted.warnings` as well.
    warnings.simplefilter("always", palpate.EvidenceWarning)
    session = server.create_session(frame_id="base", table_z=0.06, budget=25, experiment="examples")
    session.add_prior(Ball().seen_from(CAMERA), viewpoint=CAMERA)
    explored = palpate.explore(Arm(), session, robot_id="arm", on_step=tell)
    print(f"{explored.stop_reason} after {explored.attempts} attempts, {session.stats.failures} of them failed")
    print(f"{1000 * Ball().error_m(session.mesh().vertices):.2f} mm from the truth in the mean")
