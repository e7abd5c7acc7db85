"""Independent reference of METHOD_PAPER in NumPy.

It makes the expected results in `ellipsoid_cap.json` and `mustard.json`, against which
`core/tests/reference_vectors.rs` compares the Rust code. It shares nothing with that code but the
description of the method in `docs/method.md`. Lengths are in metres unless a key says otherwise.

Run with Python 3.11.7 and NumPy 2.4.6; it needs nothing else:

    python reference.py

It reads the two files beside itself, keeps what is given in them (name, attractors, camera, the
directions of the listed vertices, the numbers of the listed attractors), computes the rest and
writes both files again. Running it twice gives the same files up to rounding.

`residuals.json` and `rbf.json` are not made here. The thin plate below is checked against
`rbf.json` before anything is written.
"""

import heapq
import json
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
FILES = ("ellipsoid_cap.json", "mustard.json")

PARAMS = {
    "adam_steps": 200,
    "adam_learning_rate": 0.01,
    "adam_beta1": 0.9,
    "adam_beta2": 0.999,
    "adam_epsilon": 1e-8,
    "visual_weight_total": 80,
    "icosphere_subdivisions": 4,
    "rbf_kernel": "r2_log_r",
    "rbf_polynomial": "linear",
    "rbf_length_unit_m": 0.05,
    "rbf_smoothing": 1e-3,
    "rbf_ridge": -1e-9,
    "propagation_hops": 5,
    "propagation_length_m": 0.02,
    "candidate_min": 0.5,
    "confident_max": 0.6,
    "alpha_geodesic": 1.0,
    "alpha_uncertainty": 1.0,
}


# Template


def unit(vector):
    return vector / np.linalg.norm(vector)


def exponential(delta):
    """The rotation by the vector `delta` (Rodrigues)."""
    angle = np.linalg.norm(delta)
    cross = np.array([[0, -delta[2], delta[1]], [delta[2], 0, -delta[0]], [-delta[1], delta[0], 0]])
    if angle < 1e-12:
        return np.eye(3) + cross
    return np.eye(3) + np.sin(angle) / angle * cross + (1 - np.cos(angle)) / angle**2 * cross @ cross


def loss_and_gradient(t, p, rotation, points, weights):
    """Mean of w r^2, and its derivatives by t, p = log a and delta, with R exp([delta]x) at delta = 0."""
    b = (points - t) @ rotation  # rows are R^T (X - t)
    y = b * np.exp(-p)
    residual = (y**2).sum(axis=1) - 1
    outer = y * np.exp(-p)  # half the derivative of |y|^2 by b
    by_t = -2 * outer @ rotation.T
    by_p = -2 * y**2
    by_delta = 2 * np.cross(outer, b)  # b becomes b - delta x b
    factors = 2 * weights * residual / weights.sum()
    gradient = factors @ np.hstack([by_t, by_p, by_delta])
    return (weights * residual**2).sum() / weights.sum(), gradient


def check_gradient():
    """The gradient against central differences, at places that are not special."""
    random = np.random.default_rng(1)
    for _ in range(20):
        points = random.normal(size=(12, 3))
        weights = random.uniform(0.2, 1, 12)
        t, p = random.normal(size=3), 0.5 * random.normal(size=3)
        rotation = exponential(random.normal(size=3))

        def loss(change):
            turned = rotation @ exponential(change[6:])
            return loss_and_gradient(t + change[:3], p + change[3:6], turned, points, weights)[0]

        found = loss_and_gradient(t, p, rotation, points, weights)[1]
        h = 1e-5
        expected = np.array([(loss(h * e) - loss(-h * e)) / (2 * h) for e in np.eye(9)])
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max(), (found, expected)


def axes_of_data(offsets, towards):
    """Columns: towards the camera, along the widest spread across it, across both."""
    across = offsets - np.outer(offsets @ towards, towards)
    widest = np.linalg.eigh(across.T @ across)[1][:, -1]
    widest = unit(widest - widest @ towards * towards)
    if ((across @ widest) ** 3).sum() < 0:
        widest = -widest
    return np.column_stack([towards, widest, np.cross(towards, widest)])


def patch(x, visual):
    """Centroid of the visual points and their root mean square distance from it."""
    centroid = x[visual].mean(axis=0)
    return centroid, np.sqrt(((x[visual] - centroid) ** 2).sum(axis=1).mean())


def fit(x, visual, camera, free=False):
    """200 steps of Adam from a sphere one length behind the patch, seen from the camera."""
    centroid, length = patch(x, visual)
    points = (x - centroid) / length
    weights = np.where(visual, min(1.0, PARAMS["visual_weight_total"] / visual.sum()), 1.0)

    towards = unit(camera - centroid)
    t, p, rotation = -towards, np.zeros(3), np.eye(3)
    if free:
        rotation = axes_of_data((x - centroid)[visual], towards)

    beta1, beta2 = PARAMS["adam_beta1"], PARAMS["adam_beta2"]
    first, second = np.zeros(9), np.zeros(9)
    for step in range(1, PARAMS["adam_steps"] + 1):
        gradient = loss_and_gradient(t, p, rotation, points, weights)[1]
        first = beta1 * first + (1 - beta1) * gradient
        second = beta2 * second + (1 - beta2) * gradient**2
        unbiased = first / (1 - beta1**step), second / (1 - beta2**step)
        change = -PARAMS["adam_learning_rate"] * unbiased[0] / (np.sqrt(unbiased[1]) + PARAMS["adam_epsilon"])
        t, p = t + change[:3], p + change[3:6]
        if free:
            rotation = rotation @ exponential(change[6:])
    loss = loss_and_gradient(t, p, rotation, points, weights)[0]
    return {"centre": centroid + length * t, "semi_axes": length * np.exp(p), "R": rotation, "loss": loss}


# Meshes


def icosphere(subdivisions):
    """Directions and faces (seen from outside, counterclockwise) of a subdivided icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [[0, i, j * golden] for i in (-1, 1) for j in (-1, 1)]
    vertices = np.array([np.roll(corner, k) for corner in corners for k in range(3)])
    distance = np.linalg.norm(vertices[:, None] - vertices, axis=2)
    near = np.abs(distance - 2) < 1e-9
    triples = [(i, j, k) for i in range(12) for j in range(i) for k in range(j)]
    faces = np.array([f for f in triples if near[f[0], f[1]] and near[f[1], f[2]] and near[f[2], f[0]]])
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    inwards = np.linalg.det(vertices[faces]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    for _ in range(subdivisions):
        vertices, faces = subdivided(vertices, faces)
    return vertices, faces


def subdivided(vertices, faces):
    vertices, middles, finer = list(vertices), {}, []

    def middle(i, j):
        key = (min(i, j), max(i, j))
        if key not in middles:
            middles[key] = len(vertices)
            vertices.append(unit(vertices[i] + vertices[j]))
        return middles[key]

    for a, b, c in faces:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.array(vertices), np.array(finer)


def face_normals(vertices, faces):
    """Normals whose length is twice the face's area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(vertices, faces):
    """Mean of the normals around each vertex, weighted by area."""
    sums = np.zeros_like(vertices)
    normals = face_normals(vertices, faces)
    for k in range(3):
        np.add.at(sums, faces[:, k], normals)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def closest_points(point, vertices, faces):
    """The point of each face that is closest to `point`."""
    corners = vertices[faces]
    normals = face_normals(vertices, faces)
    squares = (normals**2).sum(axis=1)
    inner = point - (((point - corners[:, 0]) * normals).sum(axis=1) / squares)[:, None] * normals
    best, best_distance, inside = None, None, np.ones(len(faces), bool)
    for k in range(3):
        start, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        inside &= (np.cross(edge, inner - start) * normals).sum(axis=1) >= 0
        along = ((point - start) * edge).sum(axis=1) / (edge**2).sum(axis=1)
        on_edge = start + np.clip(along, 0, 1)[:, None] * edge
        distance = np.linalg.norm(on_edge - point, axis=1)
        if best is None:
            best, best_distance = on_edge, distance
        else:
            nearer = distance < best_distance
            best = np.where(nearer[:, None], on_edge, best)
            best_distance = np.where(nearer, distance, best_distance)
    return np.where(inside[:, None], inner, best)


def project(point, vertices, faces):
    """Foot on the mesh, and height over it along the normal of its face.

    A foot on an edge or a corner belongs to several faces, and each gives a height of its own. The
    height stated is the middle between the least and the largest, so that it does not depend on the
    order of the faces. Here these differ by at most 0.015 mm: whichever face an implementation
    takes, its height is within 0.0075 mm.
    """
    feet = closest_points(point, vertices, faces)
    distance = np.linalg.norm(feet - point, axis=1)
    nearest = distance.argmin()
    tied = np.flatnonzero(distance <= distance[nearest] + 1e-12)
    normals = face_normals(vertices, faces)[tied]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    heights = ((point - feet[tied]) * normals).sum(axis=1)
    assert np.ptp(heights) < 1.5e-5
    return feet[nearest], (heights.min() + heights.max()) / 2


def adjacency(faces):
    neighbours = {}
    for face in faces:
        for i in face:
            neighbours.setdefault(int(i), set()).update(int(j) for j in face if j != i)
    return neighbours


def ring(start, neighbours, hops):
    """All vertices at most `hops` edges away, the start among them."""
    reached, edge = {start}, {start}
    for _ in range(hops):
        edge = {j for i in edge for j in neighbours[i]} - reached
        reached |= edge
    return reached


# Local deformation


class ThinPlate:
    def __init__(self, feet, heights):
        self.mean = feet.mean(axis=0)
        self.z = self.scaled(feet)
        n = len(feet)
        system = np.zeros((n + 4, n + 4))
        system[:n, :n] = self.kernel(self.z) + PARAMS["rbf_smoothing"] * np.eye(n)
        system[:n, n:] = self.polynomial(self.z)
        system[n:, :n] = system[:n, n:].T
        system[n:, n:] = PARAMS["rbf_ridge"] * np.eye(4)
        self.coefficients = np.linalg.solve(system, np.concatenate([heights, np.zeros(4)]))

    def scaled(self, x):
        return (x - self.mean) / PARAMS["rbf_length_unit_m"]

    def kernel(self, z):
        r = np.linalg.norm(z[:, None] - self.z, axis=2)
        return r**2 * np.log(np.where(r > 0, r, 1.0))

    @staticmethod
    def polynomial(z):
        return np.hstack([np.ones((len(z), 1)), z])

    def __call__(self, x):
        z = self.scaled(x)
        return np.hstack([self.kernel(z), self.polynomial(z)]) @ self.coefficients


def check_thin_plate():
    file = json.loads((FOLDER / "rbf.json").read_text())
    plate = ThinPlate(np.array(file["centres"]), np.array(file["d"]))
    assert np.abs(plate(np.array(file["query"])) - file["r2log"]).max() < 1e-9


# Uncertainty and selection


def uncertainties(vertices, neighbours, x, u):
    """Confidence halves over `propagation_length_m`; the least uncertainty of all attractors counts."""
    result = np.ones(len(vertices))
    for point, own in zip(x, u):
        distance = np.linalg.norm(vertices - point, axis=1)
        reached = list(ring(int(distance.argmin()), neighbours, PARAMS["propagation_hops"]))
        spread = 1 - (1 - own) / (1 + (distance[reached] / PARAMS["propagation_length_m"]) ** 2)
        result[reached] = np.minimum(result[reached], spread)
    return result


def edge_path_lengths(start, vertices, neighbours, targets):
    """Lengths of the shortest paths along edges of the whole mesh."""
    lengths, queue, open_targets = {}, [(0.0, start)], set(targets)
    while open_targets:
        length, i = heapq.heappop(queue)
        if i in lengths:
            continue
        lengths[i] = length
        open_targets.discard(i)
        for j in neighbours[i]:
            if j not in lengths:
                heapq.heappush(queue, (length + float(np.linalg.norm(vertices[i] - vertices[j])), j))
    return [lengths[i] for i in targets]


def choose(vertices, neighbours, u):
    """The feasible vertices, and the score of each."""
    confident = u <= PARAMS["confident_max"]
    feasible = [
        v
        for v in range(len(vertices))
        if u[v] >= PARAMS["candidate_min"] and any(confident[j] for j in neighbours[v])
    ]
    depths = []
    for v in feasible:
        known = [i for i in ring(v, neighbours, PARAMS["propagation_hops"]) if confident[i] and i != v]
        depths.append(np.mean(edge_path_lengths(v, vertices, neighbours, known)))
    depths = np.array(depths)
    return feasible, (
        PARAMS["alpha_geodesic"] * depths / depths.max() + PARAMS["alpha_uncertainty"] * u[feasible]
    )


# Files


def result(given):
    x = np.array([a["x"] for a in given["attractors"]])
    u = np.array([a["u"] for a in given["attractors"]])
    visual = np.array([a["visual"] for a in given["attractors"]])
    camera = np.array(given["cam"])
    centroid, length = patch(x, visual)

    frame_first = fit(x[visual], visual[visual], camera)
    frame_all = fit(x, visual, camera)
    free_first = fit(x[visual], visual[visual], camera, free=True)
    free_all = fit(x, visual, camera, free=True)

    sphere, faces = icosphere(PARAMS["icosphere_subdivisions"])
    template = frame_all["centre"] + (sphere * frame_all["semi_axes"]) @ frame_all["R"].T
    normals = vertex_normals(template, faces)
    projections = [project(point, template, faces) for point in x]
    feet = np.array([foot for foot, _ in projections])
    heights = np.array([height for _, height in projections])
    moved = template + ThinPlate(feet, heights)(template)[:, None] * normals

    neighbours = adjacency(faces)
    u_vertices = uncertainties(moved, neighbours, x, u)
    feasible, scores = choose(moved, neighbours, u_vertices)
    best = feasible[int(scores.argmax())]

    listed = [int(i) for i in (np.array(given["unit_sphere"]) @ sphere.T).argmax(axis=1)]
    assert np.abs(sphere[listed] - given["unit_sphere"]).max() < 1e-9
    return {
        "name": given["name"],
        "units": "m",
        "params": PARAMS,
        "c0": centroid,
        "L": length,
        "cam": given["cam"],
        "attractors": given["attractors"],
        "first_fit": {key: frame_first[key] for key in ("centre", "semi_axes", "loss")},
        "ellipsoid": {
            "centre": frame_all["centre"],
            "semi_axes": frame_all["semi_axes"],
            "R_columns_are_axes": frame_all["R"],
            "loss": frame_all["loss"],
        },
        "first_free_fit": {f"free_{key}": value for key, value in free_first.items()},
        **{f"free_{key}": value for key, value in free_all.items()},
        "projections": [
            {"i": i, "p": feet[i], "d": heights[i]} for i in (row["i"] for row in given["projections"])
        ],
        "unit_sphere": given["unit_sphere"],
        "global_vertices": template[listed],
        "global_normals": normals[listed],
        "displaced_vertices": moved[listed],
        "uncertainty": u_vertices[listed],
        "uncertainty_mean": u_vertices.mean(),
        "n_u1": int((u_vertices == 1).sum()),
        "chosen_unit": sphere[best],
        "chosen_xyz": moved[best],
        "chosen_normal": vertex_normals(moved, faces)[best],
        "chosen_U": u_vertices[best],
        "chosen_score": scores.max(),
        "n_feasible": len(feasible),
        "note": "compare vertices through the directions in unit_sphere",
    }


def main():
    check_gradient()
    check_thin_plate()
    for name in FILES:
        path = FOLDER / name
        file = result(json.loads(path.read_text()))
        path.write_text(json.dumps(file, indent=1, default=lambda value: value.tolist()) + "\n")


if __name__ == "__main__":
    main()
