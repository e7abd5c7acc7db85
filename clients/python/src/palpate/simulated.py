"""A stand-in for a robot, its camera and its object, for the first ten minutes and for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate.candidates import Candidate
from palpate.outcomes import Contact, NoContact
from palpate.poses import Array, VectorLike


@dataclass(frozen=True)
class Ball:
    """A ball of `radius` metres about `center` (3,), in metres, that a point of a probe touches with 2 N."""

    center: tuple[float, float, float] = (0.5, 0.0, 0.1)
    radius: float = 0.04

    def seen_from(self, viewpoint: VectorLike, points: int = 200) -> Array:
        """(points, 3) in metres: the part of the ball that faces a camera at `viewpoint` (3,), evenly spread."""
        away = np.asarray(viewpoint, dtype=np.float64) - self.center
        distance = float(np.linalg.norm(away))
        axis = away / distance
        # Up to 80 % of the way to the horizon, where a ray from the camera grazes the ball.
        height = 1.0 - 0.8 * (1.0 - self.radius / distance)
        along = 1.0 - (1.0 - height) * (np.arange(points) + 0.5) / points
        turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(points)
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        side /= np.linalg.norm(side)
        ring = np.sqrt(1.0 - along**2)[:, None]
        directions = along[:, None] * axis
        directions = directions + ring * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side))
        seen: Array = np.asarray(self.center) + self.radius * directions
        return seen

    def probe(self, start: Array, end: Array) -> Array | None:
        """(3,) where a point that moves from `start` to `end` meets the ball, or `None`."""
        way, from_center = end - start, start - self.center
        a, b, c = way @ way, way @ from_center, from_center @ from_center - self.radius**2
        root = b * b - a * c
        if root < 0:
            return None
        share = (-b - np.sqrt(root)) / a
        touched: Array = start + share * way
        return touched if 0.0 <= share <= 1.0 else None

    def touch(self, candidate: Candidate) -> Contact | NoContact:
        """What comes of an approach to `candidate`."""
        touched = self.probe(candidate.start, candidate.end)
        return NoContact() if touched is None else Contact(touched, force=(0.0, 0.0, -2.0))

    def error_m(self, vertices: npt.ArrayLike) -> float:
        """Mean distance of `vertices` (V, 3) from the ball's surface, in metres."""
        return float(np.abs(np.linalg.norm(np.asarray(vertices) - self.center, axis=1) - self.radius).mean())
