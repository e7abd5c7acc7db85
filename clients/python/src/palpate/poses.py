"""Points, rotations and rigid transforms, as NumPy arrays and as messages.

Lengths are metres. Quaternions are x, y, z, w, as in ROS; rotations and 4x4 transforms take columns to columns:
`parent = transform @ child`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias, TypeGuard

import numpy as np
import numpy.typing as npt

from palpate import v1

Array: TypeAlias = npt.NDArray[np.float64]
#: A point or a direction: three numbers.
VectorLike: TypeAlias = npt.ArrayLike
#: A rigid transform: a 4x4 matrix, or a position (3,) and a quaternion (4,) x, y, z, w.
PoseLike: TypeAlias = npt.ArrayLike | tuple[VectorLike, npt.ArrayLike]


def vector(value: PoseLike, name: str) -> Array:
    """`value` as three finite numbers; `name` is what an error calls it."""
    array = _numbers(value, name)
    if array.shape != (3,):
        raise ValueError(f"{name} has the shape {array.shape}: three numbers x, y, z are expected")
    return array


def vector_message(value: VectorLike, name: str) -> v1.Vector3:
    """`value` as a message."""
    x, y, z = vector(value, name)
    return v1.Vector3(x=x, y=y, z=z)


def from_vector(message: v1.Vector3) -> Array:
    """A message as an array (3,)."""
    return np.array([message.x, message.y, message.z])


def matrix(pose: PoseLike, name: str) -> Array:
    """`pose` as a 4x4 matrix; an error calls it `name`.

    Raises:
        ValueError: it is neither a rigid 4x4 matrix nor a position with a unit quaternion.
    """
    if has_quaternion(pose):
        position, quaternion = vector(pose[0], f"{name}'s position"), _numbers(pose[1], f"{name}'s quaternion")
        if quaternion.shape != (4,):
            raise ValueError(f"{name}'s quaternion has the shape {quaternion.shape}: x, y, z, w are expected")
        transform = np.eye(4)
        transform[:3, :3] = rotation_of(quaternion, f"{name}'s quaternion")
        transform[:3, 3] = position
        return transform
    array = _numbers(pose, name)
    if array.shape == (16,):
        raise ValueError(
            f"{name} has 16 numbers: give it as 4x4. libfranka's O_T_EE is column by column: "
            "numpy.reshape(O_T_EE, (4, 4), order='F')"
        )
    if array.shape != (4, 4):
        raise ValueError(
            f"{name} has the shape {array.shape}: a 4x4 matrix, or (position, quaternion x, y, z, w), is expected"
        )
    if not np.allclose(array[3], [0, 0, 0, 1], atol=1e-6):
        transposed = np.allclose(array[:, 3], [0, 0, 0, 1], atol=1e-6)
        raise ValueError(f"{name}'s last row is not 0, 0, 0, 1" + (": it is transposed" if transposed else ""))
    turn = array[:3, :3]
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-3) or np.linalg.det(turn) < 0:
        raise ValueError(f"{name}'s upper left 3x3 block is no rotation")
    return array


def has_quaternion(pose: PoseLike) -> TypeGuard[tuple[VectorLike, npt.ArrayLike]]:
    """Whether `pose` is a position and a quaternion."""
    return isinstance(pose, Sequence) and len(pose) == 2


def pose_message(pose: PoseLike, name: str) -> v1.Pose:
    """`pose` as a message."""
    transform = matrix(pose, name)
    x, y, z, w = quaternion_of(transform[:3, :3])
    return v1.Pose(
        position=vector_message(transform[:3, 3], name),
        orientation=v1.Quaternion(x=x, y=y, z=z, w=w),
    )


def from_pose(message: v1.Pose) -> Array:
    """A message as a 4x4 matrix."""
    turn = message.orientation
    return matrix((from_vector(message.position), [turn.x, turn.y, turn.z, turn.w]), "the pose in the reply")


def rotation_of(quaternion: npt.ArrayLike, name: str = "the quaternion") -> Array:
    """The rotation (3, 3) of a unit quaternion x, y, z, w."""
    array = _numbers(quaternion, name)
    length = float(np.linalg.norm(array))
    if abs(length - 1.0) > 1e-3:
        raise ValueError(f"{name} has the length {length:.6g}: a rotation's is 1")
    x, y, z, w = array / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: npt.ArrayLike) -> Array:
    """The unit quaternion x, y, z, w of a rotation (3, 3); of the two, the one with w >= 0."""
    m = _numbers(rotation, "the rotation")
    # The eigenvector of Bar-Itzhack's symmetric matrix: it is stable for every angle, half turns too.
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    quaternion: Array = np.linalg.eigh(k)[1][:, -1]
    return -quaternion if quaternion[3] < 0 else quaternion


def _numbers(value: PoseLike, name: str) -> Array:
    try:
        array: Array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is not an array of numbers") from None
    if not np.isfinite(array).all():
        raise ValueError(f"{name} has a value that is not finite")
    return array
