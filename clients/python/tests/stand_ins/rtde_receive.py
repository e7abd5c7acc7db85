"""A stand-in for `rtde_receive` of ur-rtde."""

from __future__ import annotations

from ball_world import ARM


class RTDEReceiveInterface:
    def __init__(self, hostname: str) -> None:
        assert hostname.count(".") == 3

    def getActualTCPPose(self) -> list[float]:
        return [*ARM.position, *ARM.turn.as_rotvec()]

    def getActualTCPForce(self) -> list[float]:
        return list(ARM.wrench() - ARM.zero)

    def isProtectiveStopped(self) -> bool:
        return ARM.is_stopped
