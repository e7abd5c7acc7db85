#!/usr/bin/env python3
"""Lets a robot with real physics explore an object with Palpate, and says how near the surface comes to the truth.

A six-axis force/torque sensor with a flat, square pad sits on a compliant flange in MuJoCo.
It tares, moves along the approach until a force is felt, and reports the measured pose and the measured wrench:
where on the pad the object touched is left to the server.
A touch by the sensor's housing is an invalid contact, an approach that feels nothing is no contact.
What is shown first is a depth image, ray-cast from the true mesh.
The object is fixed in space, without a table, as in `palpate evaluate`.

needs: pip install './clients/python[sim]'

examples:
  mujoco_robot.py box bottle
      the generated objects, exact sensors, with a server of its own
  mujoco_robot.py --server http://127.0.0.1:7257 --realistic scans/pear.ply
      a scan in metres, a server that runs already, and sensors as they are
  mujoco_robot.py --seeds 3 --force-noise-n 0.1 --force-bias-n 0.2 box
      one fault at a time tells which one costs the most
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt
import trimesh

import palpate
from palpate.poses import quaternion_of, rotation_of

Array = npt.NDArray[np.float64]

PAD_HALF_SIDE = 0.009  # m; the pad of docs/robots.md
PAD_THICKNESS = 0.004  # m; so far the housing stands back behind the pad's face
HOUSING_RADIUS = 0.016  # m
HOUSING_LENGTH = 0.03  # m
PAD_MASS = 0.05  # kg; its weight is what taring removes
FLANGE_STIFFNESS = 1e4  # N/m, along each axis
FLANGE_TURN_STIFFNESS = 10.0  # N m/rad, about each axis
DEPTH_UNIT = 1e-4  # m
STEP = 0.0005  # s
FAST, SLOW = 0.03, 0.004  # m/s: until something is felt, and from then on
FELT_FORCE = 0.4  # N
CONTACT_FORCE = 2.0  # N: here the robot stops
SETTLE_STEPS = 120
# An approach begins this far before its own beginning, which may be within the object where the estimate is wrong.
RETREAT = 0.3  # m
# A scan collides as its triangles, each the base of a flat tetrahedron that reaches this far into the object:
# MuJoCo would take the whole mesh for its convex hull. A wall must be thicker than that.
PIECE_DEPTH = 0.001  # m
LONGEST_EDGE = 0.010  # m: longer triangles are divided, so that a face that lies flat is met in many points


@dataclass(frozen=True)
class Sensors:
    """What the sensors do wrong; the default is nothing. Standard deviations, but for the two lengths of a bias."""

    depth_noise_m: float = 0.0
    force_noise_n: float = 0.0
    torque_noise_nm: float = 0.0
    force_bias_n: float = 0.0
    torque_bias_nm: float = 0.0
    hand_eye_m: float = 0.0
    hand_eye_deg: float = 0.0


EXACT = Sensors()
REALISTIC = Sensors(
    depth_noise_m=0.002,
    force_noise_n=0.1,
    torque_noise_nm=0.002,
    force_bias_n=0.2,
    torque_bias_nm=0.002,
    hand_eye_m=0.003,
    hand_eye_deg=1.0,
)


@dataclass(frozen=True)
class Touch:
    """How an approach ended. Positions in metres and rotations in the session's frame, wrenches in the sensor's own."""

    outcome: str  # contact, no_contact, invalid_contact or collision
    swept_from: Array  # (3,) the pad's centre at the beginning, RETREAT before that of the approach
    position: Array  # (3,) the pad's centre at the end, as the robot measures it
    quaternion: Array  # (4,) x, y, z, w
    wrench: Array  # (6,) force in N and torque in N m on the tared sensor, about the centre of the pad's face

    @property
    def centre_of_pressure(self) -> Array:
        """The touched point by the wrench, (3,) in metres, in the session's frame."""
        on_pad = np.array([-self.wrench[4], self.wrench[3], 0.0]) / self.wrench[2]
        point: Array = self.position + rotation_of(self.quaternion) @ on_pad
        return point


@dataclass(frozen=True, eq=False)
class DepthImage:
    """What the camera saw of the object: 16-bit units of DEPTH_UNIT, 0 elsewhere, and how it was taken."""

    depth: npt.NDArray[np.uint16]
    intrinsics: tuple[float, float, float, float]
    base_from_camera: Array


class MujocoRobot:
    """A pad on a compliant flange, and one object that is fixed in space.

    `mesh` is closed and in metres, in the session's frame; `seed` decides the camera and all noise.
    """

    def __init__(self, mesh: trimesh.Trimesh, sensors: Sensors = EXACT, seed: int = 1) -> None:
        self.mesh = mesh
        self.sensors = sensors
        self._random = np.random.default_rng(seed)
        self._bias = np.concatenate(
            [sensors.force_bias_n * self._direction(), sensors.torque_bias_nm * self._direction()]
        )
        self._triangles: Array = np.asarray(mesh.triangles, dtype=float)
        self._middles = self._triangles.mean(axis=1)
        self._reaches = np.linalg.norm(self._triangles - self._middles[:, None], axis=2).max(axis=1)

    def approach(self, start: Array, end: Array, quaternion: Array) -> Touch:
        """Moves the pad's centre through `start` until a force is felt, or to `end`; (3,) each, in metres.

        `quaternion`, (4,) x, y, z, w, is the pad's orientation: z points out of the pad.
        """
        direction = (end - start) / np.linalg.norm(end - start)
        origin = start - RETREAT * direction
        pieces = self._pieces(origin, end)
        # Nothing happens before the pad is near the object, so the simulation begins there.
        first = min(
            (float(((middle + corners - origin) @ direction).min()) for middle, corners in pieces), default=np.inf
        )
        length = float((end - origin) @ direction)
        travelled = min(max(first - 0.003, 0.0), length)
        model = self._scene(pieces)
        data = mujoco.MjData(model)
        data.mocap_pos[0], data.mocap_quat[0] = origin + travelled * direction, scalar_first(quaternion)
        housing = model.geom("housing").id
        for _ in range(SETTLE_STEPS):
            mujoco.mj_step(model, data)
            if data.ncon:  # there is no free way to where the approach begins
                return Touch("collision", origin, origin, quaternion, np.zeros(6))
        weight = data.sensordata.copy()
        rest = np.mean([self._read(data) for _ in range(100)], axis=0)  # taring takes the time that it needs
        outcome = "no_contact"
        while travelled < length:
            felt = float(np.linalg.norm(data.sensordata[:3] - weight[:3]))
            if felt > CONTACT_FORCE:
                outcome = "contact"
                break
            travelled += STEP * (FAST if felt < FELT_FORCE else SLOW)
            data.mocap_pos[0] = origin + travelled * direction
            mujoco.mj_step(model, data)
        touching: set[int] = set()
        if outcome == "contact":
            for _ in range(SETTLE_STEPS):
                for contact in data.contact:
                    touching |= {int(contact.geom1), int(contact.geom2)}
                mujoco.mj_step(model, data)
            if housing in touching:
                outcome = "invalid_contact"
        wrench = self._read(data) - rest
        # The robot knows its flange's stiffness, and so how far the measured force bends it.
        bent = rotation_of(quaternion) @ (wrench[:3] / FLANGE_STIFFNESS) if outcome == "contact" else np.zeros(3)
        return Touch(outcome, origin, origin + travelled * direction + bent, quaternion, wrench)

    def touch(self, candidate: palpate.Candidate) -> palpate.Outcome:
        """What comes of an approach to `candidate`, as it is reported."""
        touch = self.approach(candidate.start, candidate.end, quaternion_of(candidate.pad_pose[:3, :3]))
        pose = (touch.position, touch.quaternion)
        if touch.outcome == "contact":
            return palpate.Contact(pose, touch.wrench[:3], touch.wrench[3:], swept_from=touch.swept_from)
        if touch.outcome == "no_contact":
            return palpate.NoContact(touch.swept_from, touch.position, sweep_radius_m=PAD_HALF_SIDE)
        if touch.outcome == "invalid_contact":
            return palpate.InvalidContact(pose, "the housing touched")
        return palpate.Rejected("COLLISION", "something is where the approach begins")

    def depth_image(self, share: float = 0.12, size: int = 160) -> DepthImage:
        """What the camera sees, masked to a patch of `share` of the object's surface.

        The camera stands in a random direction, three times the object's size away, and looks at its middle.
        """
        middle, extent = self.mesh.bounds.mean(axis=0), float(np.linalg.norm(self.mesh.extents))
        away = self._direction()
        position = middle + 3.0 * extent * away
        right = np.cross([0.0, 0.0, 1.0] if abs(away[2]) < 0.9 else [1.0, 0.0, 0.0], -away)
        right /= np.linalg.norm(right)
        axes = np.column_stack([right, np.cross(-away, right), -away])
        focal, centre = size * 2.6, (size - 1) / 2
        columns, rows = np.meshgrid(np.arange(size), np.arange(size))
        rays = np.column_stack(
            [(columns.ravel() - centre) / focal, (rows.ravel() - centre) / focal, np.ones(size * size)]
        )
        depth, normals = self._cast(position, rays @ axes.T)
        points = position + (rays @ axes.T) * depth[:, None]
        hit = np.flatnonzero(depth > 0)
        slant = np.abs(np.einsum("ij,ij->i", normals, rays @ axes.T)) / np.linalg.norm(rays, axis=1)
        area = (depth / focal) ** 2 * np.linalg.norm(rays, axis=1) / np.maximum(slant, 0.05)
        nearest = hit[np.argsort(np.linalg.norm(points[hit] - points[self._random.choice(hit)], axis=1))]
        seen = nearest[: 1 + np.searchsorted(np.cumsum(area[nearest]), share * self.mesh.area)]
        noisy = depth[seen] + self.sensors.depth_noise_m * self._random.standard_normal(len(seen))
        units = np.zeros(size * size, np.uint16)
        units[seen] = np.clip(np.rint(noisy / DEPTH_UNIT), 0, 65535)
        # The hand-eye error is in the pose of the camera as the robot believes it.
        turn = np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, self._direction(), np.radians(self.sensors.hand_eye_deg))
        believed = np.eye(4)
        believed[:3, :3] = rotation_of(turn[[1, 2, 3, 0]]) @ axes
        believed[:3, 3] = position + self.sensors.hand_eye_m * self._direction()
        return DepthImage(units.reshape(size, size), (focal, focal, centre, centre), believed)

    def _cast(self, origin: Array, rays: Array) -> tuple[Array, Array]:
        """Distances in lengths of the rays, -1 where nothing is hit, and normals; MuJoCo's rays meet the true mesh."""
        spec = mujoco.MjSpec()
        spec.add_mesh(
            name="object",
            uservert=self.mesh.vertices.ravel().tolist(),
            userface=self.mesh.faces.ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body = spec.worldbody.add_body(name="object")
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="object", contype=0, conaffinity=0)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        count = len(rays)
        lengths = np.linalg.norm(rays, axis=1)
        hit, distances, normals = np.zeros(count, np.int32), np.zeros(count), np.zeros(3 * count)
        unit = np.ascontiguousarray((rays / lengths[:, None]).ravel())
        mujoco.mj_multiRay(model, data, origin, unit, None, True, -1, hit, distances, normals, count, mujoco.mjMAXVAL)
        return np.where(hit >= 0, distances / lengths, -1.0), normals.reshape(-1, 3)

    def _scene(self, pieces: list[tuple[Array, Array]]) -> mujoco.MjModel:
        """The sensor on its flange, and the part of the object that it can meet."""
        spec = mujoco.MjSpec()
        spec.option.timestep = STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        hard = {"solref": [2 * STEP, 1.0], "solimp": [0.99, 0.999, 0.0001, 0.5, 2.0]}
        flange = spec.worldbody.add_body(name="flange", mocap=True)
        sensor = flange.add_body(name="sensor", mass=PAD_MASS, inertia=[1e-4] * 3, explicitinertial=True)
        for axis in np.eye(3):
            sensor.add_joint(
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=axis,
                stiffness=[FLANGE_STIFFNESS, 0, 0],
                damping=[1.5 * np.sqrt(FLANGE_STIFFNESS * PAD_MASS), 0, 0],
            )
        for axis in np.eye(3):
            sensor.add_joint(
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=axis,
                stiffness=[FLANGE_TURN_STIFFNESS, 0, 0],
                damping=[1.5 * np.sqrt(FLANGE_TURN_STIFFNESS * 1e-4), 0, 0],
            )
        half = [PAD_HALF_SIDE, PAD_HALF_SIDE, PAD_THICKNESS / 2]
        sensor.add_geom(
            name="pad",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=half,
            pos=[0, 0, -PAD_THICKNESS / 2],
            contype=1,
            conaffinity=2,
            **hard,
        )
        sensor.add_geom(
            name="housing",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[HOUSING_RADIUS, HOUSING_LENGTH / 2, 0],
            pos=[0, 0, -PAD_THICKNESS - HOUSING_LENGTH / 2],
            contype=1,
            conaffinity=2,
            **hard,
        )
        sensor.add_site(name="face", pos=[0, 0, 0])
        for kind in (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE):
            spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="face")
        body = spec.worldbody.add_body(name="object")
        for number, (middle, corners) in enumerate(pieces):
            spec.add_mesh(
                name=f"piece {number}",
                uservert=corners.ravel().tolist(),
                userface=[0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0],
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=f"piece {number}",
                pos=middle,
                contype=2,
                conaffinity=1,
                **hard,
            )
        return spec.compile()

    def _pieces(self, start: Array, end: Array) -> list[tuple[Array, Array]]:
        """Flat tetrahedra on the triangles near the way: their middle and, about it, their corners (4, 3)."""
        direction = (end - start) / np.linalg.norm(end - start)
        back = start - (PAD_THICKNESS + HOUSING_LENGTH) * direction
        along = np.clip((self._middles - back) @ direction, 0.0, float((end - back) @ direction))
        off = np.linalg.norm(self._middles - back - along[:, None] * direction, axis=1)
        triangles = divided(self._triangles[off < HOUSING_RADIUS + self._reaches + 0.003])
        middles = triangles.mean(axis=1)
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
        along = np.clip((middles - back) @ direction, 0.0, float((end - back) @ direction))
        off = np.linalg.norm(middles - back - along[:, None] * direction, axis=1)
        # Triangles thinner than 0.02 mm are left out: their neighbours cover them.
        kept = (off < HOUSING_RADIUS + longest + 0.003) & (lengths > 2e-5 * longest)
        apexes = middles[kept] - PIECE_DEPTH * normals[kept] / lengths[kept, None]
        corners = np.concatenate([triangles[kept], apexes[:, None]], axis=1)
        return list(zip(middles[kept], corners - middles[kept, None], strict=True))

    def _read(self, data: mujoco.MjData) -> Array:
        """The sensor's reading now, (6,): MuJoCo's force is that of the sensor on the flange's side, so it is turned round."""
        noise = np.repeat([self.sensors.force_noise_n, self.sensors.torque_noise_nm], 3)
        reading: Array = -data.sensordata + self._bias + noise * self._random.standard_normal(6)
        return reading

    def _direction(self) -> Array:
        vector: Array = self._random.standard_normal(3)
        return vector / np.linalg.norm(vector)


def divided(triangles: Array) -> Array:
    """The same surface in triangles whose edges are no longer than LONGEST_EDGE, (n, 3, 3)."""
    done: list[Array] = []
    while len(triangles):
        ends = np.roll(triangles, -1, axis=1)
        edges = np.linalg.norm(ends - triangles, axis=2)
        short = edges.max(axis=1) <= LONGEST_EDGE
        done.append(triangles[short])
        triangles, edges = triangles[~short], edges[~short]
        if not len(triangles):
            break
        first = edges.argmax(axis=1)
        each = np.arange(len(triangles))
        a, b, c = (triangles[each, (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else np.zeros((0, 3, 3))


def scalar_first(quaternion: Array) -> Array:
    return np.asarray(quaternion, float)[[3, 0, 1, 2]]


def explore(client: palpate.Client, robot: MujocoRobot, attempts: int, share: float) -> dict[str, float]:
    """Explores the robot's object with `attempts` attempts; the figures that come out, by name."""
    sensors = robot.sensors
    pad = palpate.sensor(
        "pad",
        np.eye(4),
        pad_half_side_m=PAD_HALF_SIDE,
        force_noise_n=sensors.force_noise_n or None,
        torque_noise_nm=sensors.torque_noise_nm or None,
    )
    session = client.create_session(sensors=[pad])
    view = robot.depth_image(share)
    session.add_depth(view.depth, view.intrinsics, view.base_from_camera, depth_scale_m=DEPTH_UNIT)
    proposal: palpate.Candidates = session.candidates()
    for _ in range(attempts):  # whatever the server advises, so that all runs are equally long
        if not proposal:
            break
        proposal = session.report(proposal[0], robot.touch(proposal[0]))
    evaluation = session.evaluate(robot.mesh)
    figures: dict[str, float] = {field.name: value for field, value in evaluation.ListFields()}
    mesh = session.mesh()
    offsets = trimesh.proximity.closest_point(robot.mesh, mesh.vertices)[1]  # type: ignore[no-untyped-call]
    figures["correlation"] = float(np.corrcoef(mesh.uncertainty, offsets)[0, 1])
    return figures


# Name, field of the Evaluation, factor, digits: the rows of `palpate evaluate`, and three more.
ROWS = [
    ("chamfer, mm, 13000 samples", "chamfer_sum_m", 1000, 2),
    ("sampling floor", "chamfer_floor_m", 1000, 2),
    ("failures of {attempts}", "failures", 1, 1),
    ("of these, missed", "no_contacts", 1, 1),
    ("of these, early", "early_contacts", 1, 1),
    ("of these, invalid contacts", "invalid_contacts", 1, 1),
    ("of these, not tried", "rejected", 1, 1),
    ("surface distance, mm", "surface_distance_m", 1000, 2),
    ("Hausdorff distance, mm", "hausdorff_m", 1000, 1),
    ("F-score at 1 mm", "f_score_1mm", 1, 2),
    ("coverage at 2 mm", "coverage", 1, 2),
    ("volume, of the true one", "volume_ratio", 1, 2),
    ("true error within 2 sigma", "calibration_2sigma", 1, 3),
    ("correlation of u with the true offset", "correlation", 1, 2),
]


def table(runs: dict[str, list[dict[str, float]]], attempts: int) -> str:
    """Mean ± standard deviation over the seeds, one column an object, laid out as by `palpate evaluate`."""
    lines = [f"| metric | {' | '.join(runs)} | mean |", "|---" * (len(runs) + 2) + "|"]
    for name, field, factor, digits in ROWS:
        cells, means = [], []
        for figures in runs.values():
            values = factor * np.array([float(run.get(field, 0)) for run in figures])
            means.append(values.mean())
            spread = f" ± {values.std(ddof=1):.{digits}f}" if len(values) > 1 else ""
            cells.append(f"{values.mean():.{digits}f}{spread}")
        lines.append(f"| {name.format(attempts=attempts)} | {' | '.join(cells)} | {np.mean(means):.{digits}f} |")
    return "\n".join(lines)


def generated(name: str) -> trimesh.Trimesh:
    """The objects that need no file: a box, and a bottle with a neck."""
    if name == "box":
        box: trimesh.Trimesh = trimesh.creation.box((0.06, 0.09, 0.13))
        return box
    shoulder = [(0.032, -0.09), (0.032, 0.03), (0.028, 0.045), (0.018, 0.058), (0.013, 0.066), (0.013, 0.09)]
    bottle: trimesh.Trimesh = trimesh.creation.revolve([(0.0, -0.09), *shoulder, (0.0, 0.09)], sections=96)
    return bottle


def load(name: str) -> trimesh.Trimesh:
    if name in ("box", "bottle"):
        return generated(name)
    if not Path(name).is_file():
        raise SystemExit(
            f"{name} is neither box nor bottle nor a file: give the path of a .ply, .stl or .obj in metres"
        )
    mesh = trimesh.load(name, force="mesh")
    if not isinstance(mesh, trimesh.Trimesh) or not mesh.is_watertight:
        raise SystemExit(f"{name} is no closed triangle mesh: close it first, or inside and outside are not known")
    if mesh.extents.max() > 1.0:
        raise SystemExit(f"{name} is {mesh.extents.max():.0f} m long: scale it to metres first")
    return mesh


def options(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "objects", nargs="+", metavar="OBJECT", help="box, bottle, or the path of a closed mesh in metres"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--server", metavar="URL", help="a server that runs, such as http://127.0.0.1:7257")
    where.add_argument(
        "--palpate",
        metavar="PROGRAM",
        help="start this program as a server, with a database to throw away "
        "(default: PALPATE_BINARY, the one that pip installed, or that in the path)",
    )
    parser.add_argument(
        "--attempts", type=int, default=50, help="attempts of each run, failures included (default: 50)"
    )
    parser.add_argument(
        "--seeds", type=int, default=1, help="runs of each object, with the seeds 1, 2, ... (default: 1)"
    )
    parser.add_argument(
        "--patch", type=float, default=0.12, help="share of the surface that the camera sees (default: 0.12)"
    )
    parser.add_argument(
        "--runs", metavar="FILE", help="append the figures of each run to this file, one JSON object a line"
    )
    parser.add_argument(
        "--save-meshes", metavar="FOLDER", help="write the objects there as PLY, for `palpate evaluate --meshes`"
    )
    parser.add_argument(
        "--realistic", action="store_true", help="all faults below at once, each at the value in brackets"
    )
    faults = parser.add_argument_group("faults of the sensors, none unless given")
    for field, value in REALISTIC.__dict__.items():
        faults.add_argument(f"--{field.replace('_', '-')}", type=float, metavar="X", help=f"[{value:g}]")
    return parser.parse_args(arguments)


def main() -> None:
    chosen = options()
    base = REALISTIC if chosen.realistic else EXACT
    given = {field: getattr(chosen, field) for field in base.__dict__}
    sensors = Sensors(**{field: getattr(base, field) if value is None else value for field, value in given.items()})
    meshes = {Path(name).stem: load(name) for name in chosen.objects}
    if chosen.save_meshes:
        Path(chosen.save_meshes).mkdir(parents=True, exist_ok=True)
        for name, mesh in meshes.items():
            mesh.export(Path(chosen.save_meshes) / f"{name}.ply")
    # With 50 attempts of a robot with faults there are some doubts; the table says what they came to.
    warnings.simplefilter("ignore", palpate.EvidenceWarning)
    with ExitStack() as stack:
        url = chosen.server or stack.enter_context(palpate.local_server(chosen.palpate)).url
        client = stack.enter_context(palpate.Client(url))
        runs: dict[str, list[dict[str, float]]] = {}
        for seed in range(1, chosen.seeds + 1):
            for name, mesh in meshes.items():
                figures = explore(client, MujocoRobot(mesh, sensors, seed), chosen.attempts, chosen.patch)
                runs.setdefault(name, []).append(figures)
                if chosen.runs:
                    with Path(chosen.runs).open("a") as lines:
                        lines.write(json.dumps({"object": name, "seed": seed, **figures}) + "\n")
                error = 1000 * figures["surface_distance_m"]
                failures = figures.get("failures", 0)
                print(f"{name}, seed {seed}: {error:.2f} mm, {failures} failures", file=sys.stderr)
        print(table(runs, chosen.attempts))


if __name__ == "__main__":
    main()
