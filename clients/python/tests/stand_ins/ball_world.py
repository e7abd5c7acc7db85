"""What the stand-ins share: a ball on a table, and an arm with a tip whose wrist feels a force."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]

CENTER, RADIUS = np.array([0.5, 0.0, 0.1]), 0.04  # m, in the base's frame
TABLE_Z = 0.06
STIFFNESS = 20_000.0  # N/m of the ball's surface
OFFSET = np.array([1.5, -0.8, 3.0, 0.05, 0.02, -0.01])  # N and N m, as an untared sensor shows
PERIOD = 0.002  # s


class Arm:
    """A tip that moves along straight lines. Positions are in metres, in the base's frame."""

    def __init__(self) -> None:
        self.position, self.turn = np.array([0.3, 0.0, 0.5]), Rotation.from_rotvec([np.pi, 0.0, 0.0])
        self.goal: Array | None = None
        self.speed = 0.0
        self.zero = np.zeros(6)
        self.has_tcp = False
        self.is_stopped = False

    def wrench(self) -> Array:
        """On the tip, turned as the base is, with the sensor's own offset."""
        away = self.position - CENTER
        depth = max(0.0, RADIUS - float(np.linalg.norm(away)))
        force = STIFFNESS * depth * away / np.linalg.norm(away)
        wrench: Array = np.concatenate([force, np.zeros(3)]) + OFFSET
        return wrench

    def is_blocked(self, position: Array) -> bool:
        """Whether a tip there is more than a millimetre in the ball, or in the table."""
        return float(np.linalg.norm(position - CENTER)) < RADIUS - 0.001 or bool(position[2] < TABLE_Z)

    def go(self, position: Array, turn: Rotation) -> bool:
        """The whole way at once; it ends with a protective stop where something is in the way."""
        for share in np.linspace(0.0, 1.0, 400):
            if self.is_blocked(self.position + share * (position - self.position)):
                self.is_stopped = True
                return False
        self.position, self.turn = position, turn
        return True

    def step(self) -> None:
        """One period of a move that nobody waits for."""
        if self.goal is None:
            return
        way = self.goal - self.position
        length, step = float(np.linalg.norm(way)), self.speed * PERIOD
        self.position = self.goal if length <= step else self.position + step / length * way
        self.is_stopped = self.is_stopped or self.is_blocked(self.position)


ARM = Arm()
