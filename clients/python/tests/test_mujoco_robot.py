"""The robot of examples/mujoco_robot.py against what can be worked out by hand, and once against a real server."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="pip install './clients/python[sim]'")
pytest.importorskip("trimesh", reason="pip install './clients/python[sim]'")

import numpy as np
import trimesh

import palpate
from palpate.poses import rotation_of

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "clients/python/examples"))

from mujoco_robot import (  # noqa: E402
    DEPTH_UNIT,
    FLANGE_STIFFNESS,
    PAD_MASS,
    REALISTIC,
    RETREAT,
    Array,
    MujocoRobot,
    Sensors,
    Touch,
    divided,
    explore,
    generated,
)

DOWN = np.array(
    [1.0, 0.0, 0.0, 0.0]
)  # x, y, z, w: the pad's z axis points down, its x axis along x, its y axis along -y
RADIUS = 0.04
# The reported pose knows nothing of how far the pad's own weight bends the flange, and 2 N press in by micrometres.
SAG = PAD_MASS * 9.81 / FLANGE_STIFFNESS
NEAR = 2e-5  # m


def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)


def from_above(robot: MujocoRobot, x: float, y: float = 0.0, high: float = 0.1, low: float = 0.0) -> Touch:
    return robot.approach(np.array([x, y, high]), np.array([x, y, low]), DOWN)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.004, 0.0), (-0.006, 0.003), (0.0, -0.008)])
def test_a_flat_pad_on_a_ball_touches_its_top(x: float, y: float) -> None:
    touch = from_above(MujocoRobot(ball()), x, y)
    assert touch.outcome == "contact"
    np.testing.assert_allclose(
        touch.position, [x, y, RADIUS + SAG], atol=5e-5
    )  # the pad tilts a little under a load at its rim
    assert -2.2 < touch.wrench[2] < -1.7
    np.testing.assert_allclose(touch.wrench[:2], 0, atol=0.02)
    # The force acts at the ball's top, (-x, y) in the pad's axes: torque = lever x force.
    np.testing.assert_allclose(touch.wrench[3:], np.cross([-x, y, 0.0], touch.wrench[:3]), atol=2e-4)
    np.testing.assert_allclose(touch.centre_of_pressure[:2], 0, atol=1e-4)


def test_the_rim_of_the_pad_touches_a_ball_where_geometry_says() -> None:
    touch = from_above(MujocoRobot(ball()), 0.02)
    rim = 0.02 - 0.009
    expected = [rim, 0.0, np.sqrt(RADIUS**2 - rim**2)]
    np.testing.assert_allclose(touch.centre_of_pressure, expected, atol=2e-4)


def test_a_face_that_lies_flat_is_pressed_in_the_middle() -> None:
    touch = from_above(MujocoRobot(generated("box")), 0.01, -0.02)
    np.testing.assert_allclose(touch.centre_of_pressure, [0.01, -0.02, 0.065 + SAG], atol=NEAR)
    np.testing.assert_allclose(touch.wrench[3:], 0, atol=1e-4)


def test_the_edge_of_a_box_is_felt_where_it_is() -> None:
    # The pad, from x = 29 mm on, is on the box's last millimetre and tilts about its edge.
    touch = from_above(MujocoRobot(generated("box")), 0.038)
    np.testing.assert_allclose(touch.centre_of_pressure, [0.03, 0.0, 0.065 + SAG], atol=2e-4)


def test_a_slanted_approach_is_measured_in_the_session_s_frame() -> None:
    normal = np.array([1.0, 2.0, 2.0]) / 3
    axis = np.cross([0.0, 0.0, 1.0], -normal)
    angle = np.arccos(-normal[2])
    quaternion = np.append(np.sin(angle / 2) * axis / np.linalg.norm(axis), np.cos(angle / 2))
    np.testing.assert_allclose(rotation_of(quaternion)[:, 2], -normal, atol=1e-12)
    touch = MujocoRobot(ball()).approach(0.055 * normal, 0.025 * normal, quaternion)
    vertices = ball().vertices  # of the mesh the pad meets the vertex that stands out the farthest
    np.testing.assert_allclose(touch.centre_of_pressure, vertices[np.argmax(vertices @ normal)], atol=2e-4)


def test_nothing_felt_is_no_contact_to_the_end() -> None:
    touch = from_above(MujocoRobot(ball()), 0.06)
    assert touch.outcome == "no_contact"
    np.testing.assert_allclose(touch.swept_from, [0.06, 0, 0.1 + RETREAT])
    np.testing.assert_allclose(touch.position, [0.06, 0, 0.0], atol=5e-5)


def test_a_touch_by_the_housing_is_invalid() -> None:
    # The pad reaches to 35 mm, the box to 30: only the housing, which reaches to 28, meets it.
    assert from_above(MujocoRobot(generated("box")), 0.044).outcome == "invalid_contact"


def test_an_approach_that_begins_within_the_object_is_felt_on_the_way() -> None:
    touch = from_above(MujocoRobot(ball()), 0.0, high=0.01, low=-0.02)
    assert touch.outcome == "contact"
    np.testing.assert_allclose(touch.position, [0, 0, RADIUS + SAG], atol=NEAR)


def test_taring_removes_bias_and_weight() -> None:
    biased = from_above(MujocoRobot(ball(), Sensors(force_bias_n=5.0, torque_bias_nm=0.1)), 0.004)
    exact = from_above(MujocoRobot(ball()), 0.004)
    np.testing.assert_allclose(biased.wrench, exact.wrench, atol=1e-9)


def test_noise_is_as_large_as_it_is_said() -> None:
    robot, exact = (
        MujocoRobot(ball(), Sensors(force_noise_n=0.1, torque_noise_nm=0.002)),
        from_above(MujocoRobot(ball()), 0.0),
    )
    off = np.array([from_above(robot, 0.0, high=0.06, low=0.03).wrench - exact.wrench for _ in range(30)])
    np.testing.assert_allclose(off[:, :3].std(), 0.1, rtol=0.3)
    np.testing.assert_allclose(off[:, 3:].std(), 0.002, rtol=0.3)


def test_a_hollow_is_no_convex_hull() -> None:
    outer, inner = trimesh.creation.box((0.12, 0.12, 0.06)), trimesh.creation.box((0.08, 0.08, 0.06))
    inner.apply_translation([0, 0, 0.01])
    # An open tray: walls 20 mm thick and a floor that is 10 mm thick, at z = -20 mm.
    tray = tray_of(outer, inner)
    touch = from_above(MujocoRobot(tray), 0.0, high=0.0, low=-0.04)
    assert touch.outcome == "contact"
    np.testing.assert_allclose(touch.centre_of_pressure, [0, 0, -0.02 + SAG], atol=NEAR)
    assert from_above(MujocoRobot(tray), 0.05).position[2] == pytest.approx(0.03 + SAG, abs=NEAR)


def tray_of(outer: trimesh.Trimesh, inner: trimesh.Trimesh) -> trimesh.Trimesh:
    """A block with a square hole from above, by hand: a ring on top and the hole's walls and floor."""
    (x, y, z), (a, b, floor) = outer.bounds[1], (*inner.bounds[1][:2], inner.bounds[0][2])
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    rings: Array = np.concatenate(
        [
            np.column_stack([square * s, np.full(4, h)])
            for s, h in [((x, y), -z), ((x, y), z), ((a, b), z), ((a, b), floor)]
        ]
    )
    faces = [[0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]]
    for ring in range(3):
        for k in range(4):
            p, q = 4 * ring + k, 4 * ring + (k + 1) % 4
            faces += [[p, q, q + 4], [p, q + 4, p + 4]]
    mesh = trimesh.Trimesh(rings, faces)
    assert mesh.is_watertight and mesh.volume > 0
    return mesh


def test_dividing_keeps_the_surface() -> None:
    triangles = divided(np.asarray(generated("box").triangles))
    area = (
        np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1).sum() / 2
    )
    assert area == pytest.approx(generated("box").area)


@pytest.mark.parametrize("share", [0.05, 0.12])
def test_the_depth_image_shows_a_patch_of_the_true_surface(share: float) -> None:
    view = MujocoRobot(ball(), seed=3).depth_image(share)
    fx, fy, cx, cy = view.intrinsics
    rows, columns = np.nonzero(view.depth)
    depth = view.depth[rows, columns, None] * DEPTH_UNIT
    at = depth * np.column_stack([(columns - cx) / fx, (rows - cy) / fy, np.ones(len(rows))])
    points = at @ view.base_from_camera[:3, :3].T + view.base_from_camera[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), RADIUS, atol=2e-4)
    # A cap of this share of a ball's surface is 2 * share * RADIUS high; away from the rim the patch is such a cap.
    assert len(points) > 200
    middle = points.mean(axis=0) / np.linalg.norm(points.mean(axis=0))
    assert (points @ middle).min() < RADIUS * (1 - 1.2 * share)


@pytest.mark.filterwarnings("ignore::palpate.EvidenceWarning")
def test_a_box_is_explored_with_a_real_server(client: palpate.Client) -> None:
    exact = explore(client, MujocoRobot(generated("box")), 20, 0.12)
    noisy = explore(client, MujocoRobot(generated("bottle"), REALISTIC), 20, 0.12)
    assert exact["surface_distance_m"] < 0.0015
    assert noisy["surface_distance_m"] < 0.005
    assert exact["failures"] < 10
