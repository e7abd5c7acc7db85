"""A stand-in for `rtde_control` of ur-rtde."""

from __future__ import annotations

import time

import numpy as np
from ball_world import ARM
from scipy.spatial.transform import Rotation


class RTDEControlInterface:
    def __init__(self, hostname: str) -> None:
        assert hostname.count(".") == 3

    def setTcp(self, tcp_offset: list[float]) -> bool:
        assert len(tcp_offset) == 6
        ARM.has_tcp = True
        return True

    def isPoseWithinSafetyLimits(self, pose: list[float]) -> bool:
        # What is on the far side of the ball is out of reach.
        return pose[0] < 0.53

    def moveL(self, pose: list[float], speed: float, acceleration: float, asynchronous: bool) -> bool:
        assert ARM.has_tcp and len(pose) == 6 and 0 < speed <= 0.25 and acceleration > 0
        if ARM.is_stopped:
            return False
        position, turn = np.array(pose[:3]), Rotation.from_rotvec(pose[3:])
        if not asynchronous:
            ARM.goal = None
            return ARM.go(position, turn)
        ARM.goal, ARM.speed, ARM.turn = position, speed, turn
        return True

    def stopL(self, a: float) -> None:
        assert a > 0
        ARM.goal = None

    def zeroFtSensor(self) -> bool:
        ARM.zero = ARM.wrench()
        return True

    def initPeriod(self) -> float:
        return time.monotonic()

    def waitPeriod(self, period: float) -> None:
        assert period <= time.monotonic()
        ARM.step()
