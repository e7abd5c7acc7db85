"""A stand-in for `sksurgerynditracker.nditracker` of scikit-surgerynditracker."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from hand import HAND, Array


class NDITracker:
    def __init__(self, configuration: dict[str, Any]) -> None:
        assert configuration["tracker type"] == "polaris" and len(configuration["romfiles"]) == 2
        self.is_tracking = False

    def start_tracking(self) -> None:
        self.is_tracking = True

    def get_frame(self) -> tuple[list[int], list[float], list[int], list[Array], list[float]]:
        """Port handles, times, numbers, 4x4 poses in millimetres, and how good they are."""
        assert self.is_tracking
        poses = list(HAND.poses())
        for pose in poses:
            pose[:3, 3] *= 1000
        # A hand is in the way for two frames of nine, also while the tip touches.
        if HAND.frame % 9 < 2:
            poses[HAND.frame % 2] = np.full((4, 4), np.nan)
        HAND.advance()
        return [1, 2], [time.time()] * 2, [HAND.frame] * 2, poses, [0.1, 0.1]
