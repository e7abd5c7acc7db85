"""A person who presses a probe against a ball that the other hand turns, as a tracker and a load cell see it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]

CENTER, RADIUS = np.array([0.0, 0.0, 0.08]), 0.04  # m, in the frame of the object's marker
COMPLIANCE = 1e-4  # m/N
FRAMES = 30  # of one press


def transform(turn: Rotation, position: npt.ArrayLike) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.as_matrix(), position
    return pose


#: Where the tip is on the probe's marker: 120 mm along its z axis, turned about it.
PROBE_FROM_TIP = transform(Rotation.from_euler("zx", [90, 20], degrees=True), [0.01, 0.0, 0.12])


class Hand:
    def __init__(self) -> None:
        self.random = np.random.default_rng(5)
        self.frame = 0
        self.toward = self.random.normal(size=3)

    def advance(self) -> None:
        self.frame += 1
        if self.frame % FRAMES == 0:
            self.toward = self.random.normal(size=3)

    def newtons(self) -> float:
        """The load cell: a press rises to 3 N and falls again; it shows a little when nothing touches."""
        at = (self.frame % FRAMES) / FRAMES
        return max(0.02, 3.0 * np.sin(np.pi * (at - 0.3) / 0.4)) if 0.3 < at < 0.7 else 0.02

    def poses(self) -> tuple[Array, Array]:
        """Of the probe's marker and of the object's, in the tracker's frame, in metres."""
        out = self.toward / np.linalg.norm(self.toward)
        force = self.newtons()
        height = 0.03 if force < 0.1 else -COMPLIANCE * force
        along = Rotation.align_vectors([-out], [[0.0, 0.0, 1.0]])[0]
        object_from_tip = transform(along, CENTER + (RADIUS + height) * out)
        slowly = Rotation.from_euler("zyx", [0.3 * self.frame, 0.1 * self.frame, 20.0], degrees=True)
        tracker_from_object = transform(slowly, [0.1, -0.2, -1.2 + 1e-5 * self.frame])
        return tracker_from_object @ object_from_tip @ np.linalg.inv(PROBE_FROM_TIP), tracker_from_object


HAND = Hand()
