"""Rotations against what is known of them."""

import numpy as np
import pytest

from palpate.poses import matrix, pose_message, quaternion_of, rotation_of, vector


def test_a_quarter_turn_about_z_takes_x_to_y() -> None:
    half = np.sqrt(0.5)
    turn = rotation_of([0, 0, half, half])
    assert turn @ [1, 0, 0] == pytest.approx([0, 1, 0])
    assert quaternion_of(turn) == pytest.approx([0, 0, half, half])


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-9, np.pi])
def test_a_rotation_is_that_of_its_quaternion(axis: tuple[float, float, float], angle: float) -> None:
    quaternion = np.append(np.sin(angle / 2) * np.array(axis), np.cos(angle / 2))
    turn = rotation_of(quaternion)
    assert turn @ axis == pytest.approx(axis)
    assert np.trace(turn) == pytest.approx(1 + 2 * np.cos(angle))
    found = quaternion_of(turn)
    assert min(np.abs(found - quaternion).max(), np.abs(found + quaternion).max()) < 1e-7


def test_random_rotations_go_there_and_back() -> None:
    for quaternion in np.random.default_rng(1).standard_normal((200, 4)):
        unit = quaternion / np.linalg.norm(quaternion) * (1 if quaternion[3] >= 0 else -1)
        assert quaternion_of(rotation_of(unit)) == pytest.approx(unit, abs=1e-9)


def test_a_pose_is_a_matrix_or_a_position_with_a_quaternion() -> None:
    message = pose_message(([0.1, 0.2, 0.3], [1, 0, 0, 0]), "pose")
    same = pose_message(np.array([[1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 0.3], [0, 0, 0, 1]]), "pose")
    assert message.position.y == 0.2
    assert message.orientation.x == pytest.approx(1)
    assert same.position == message.position
    assert same.orientation.x == pytest.approx(1)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (np.eye(3), "shape"),
        (np.arange(16.0), "order='F'"),
        (np.eye(4) + np.eye(4)[[3, 0, 1, 2]], "last row"),
        (np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0.1, 0.2, 0.3, 1]]), "transposed"),
        (np.diag([2.0, 1, 1, 1]), "no rotation"),
        (np.diag([-1.0, 1, 1, 1]), "no rotation"),
        (([0, 0, 0], [0, 0, 0, 2]), "length 2"),
        (([0, 0, 0], [0, 0, 1]), "x, y, z, w"),
        (([0, 0], [0, 0, 0, 1]), "three numbers"),
        (np.full((4, 4), np.nan), "finite"),
        ("here", "numbers"),
    ],
)
def test_what_is_no_pose_is_called_by_its_name(pose: object, words: str) -> None:
    with pytest.raises(ValueError, match="tool_pose.*") as refused:
        matrix(pose, "tool_pose")  # type: ignore[arg-type]
    assert words in str(refused.value)


def test_a_vector_has_three_numbers() -> None:
    with pytest.raises(ValueError, match=r"force has the shape \(2,\)"):
        vector([1, 2], "force")
