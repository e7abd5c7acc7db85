"""The contact step of METHOD_PAPER with SciPy and trimesh, beside ours, on the same attractors and one thread.

    pip install numpy scipy trimesh rtree
    python core/benches/contact_step.py

Builds and runs `core/examples/contact_step.rs`, which prints its attractors and the time of its last
steps, then does the same step in Python with the libraries as they are meant to be used: what depends on the
icosphere alone is computed once, every loop over points is one call. Prints the times and their ratio.
"""

import os

for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR"):
    os.environ[f"{library}_NUM_THREADS"] = "1"  # before NumPy is loaded

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import trimesh
from scipy.interpolate import RBFInterpolator
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix, identity
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

SEEN, VIEWPOINT = 200, np.array([0.6, 0.1, 0.2])
VISUAL_TOUCHES = 80.0  # all visual points together weigh as much as this many touches
LENGTH_UNIT_M, SMOOTHING = 0.05, 1e-3
HOPS, REACH_M = 5, 0.02
CONFIDENT_MAX, CANDIDATE_MIN = 0.6, 0.5

SPHERE = trimesh.creation.icosphere(subdivisions=4)
EDGES = SPHERE.edges_unique
COUNT = len(SPHERE.vertices)
ONE_WAY = csr_matrix((np.ones(len(EDGES)), EDGES.T), shape=(COUNT, COUNT))
ADJACENT = (ONE_WAY + ONE_WAY.T).tocsr()


def ring_of_each_vertex():
    """Which vertices lie within the hops of which."""
    reached = identity(COUNT, format="csr")
    for _ in range(HOPS):
        reached = reached @ (ADJACENT + identity(COUNT))
        reached.data[:] = 1.0
    return reached.tocsr()


RINGS = ring_of_each_vertex()


def fit_ellipsoid(points, touched):
    """Section III-D: centre and semi-axes that minimise (|y|² - 1)², in lengths of the visual patch."""
    seen = points[~touched]
    origin = seen.mean(axis=0)
    length_m = np.sqrt(((seen - origin) ** 2).sum(axis=1).mean())
    local = (points - origin) / length_m
    weight = np.sqrt(np.where(touched, 1.0, min(VISUAL_TOUCHES / len(seen), 1.0)))
    behind = -(VIEWPOINT - origin) / np.linalg.norm(VIEWPOINT - origin)

    def residuals(q):
        y = (local - q[:3]) * np.exp(-q[3:])
        return weight * ((y * y).sum(axis=1) - 1.0)

    def jacobian(q):
        y = (local - q[:3]) * np.exp(-q[3:])
        return np.hstack([-2.0 * y * np.exp(-q[3:]), -2.0 * y * y]) * weight[:, None]

    start = np.concatenate([behind, np.zeros(3)])
    q = least_squares(residuals, start, jacobian, method="lm", max_nfev=30).x
    return origin + q[:3] * length_m, np.exp(q[3:]) * length_m


def contact_step(points, uncertainty, touched):
    """From all attractors to the vertex to touch next."""
    centre, semi_axes = fit_ellipsoid(points, touched)
    mesh = trimesh.Trimesh(SPHERE.vertices * semi_axes + centre, SPHERE.faces, process=False)

    # Section III-E, Eq. (2): heights over the template, and a thin plate through them.
    feet, _, faces = trimesh.proximity.closest_point(mesh, points)
    heights = np.einsum("ij,ij->i", points - feet, mesh.face_normals[faces])
    plate = RBFInterpolator(
        feet / LENGTH_UNIT_M, heights, kernel="thin_plate_spline", smoothing=SMOOTHING, degree=1
    )
    vertices = mesh.vertices + mesh.vertex_normals * plate(mesh.vertices / LENGTH_UNIT_M)[:, None]

    # Section III-F: confidence decays with the distance from the attractors whose ring reaches a vertex.
    _, nearest = cKDTree(vertices).query(points)
    rings = RINGS[nearest]
    attractor = np.repeat(np.arange(len(points)), np.diff(rings.indptr))
    distance_m = np.linalg.norm(vertices[rings.indices] - points[attractor], axis=1)
    u = np.ones(COUNT)
    spread = 1.0 - (1.0 - uncertainty[attractor]) / (1.0 + (distance_m / REACH_M) ** 2)
    np.minimum.at(u, rings.indices, spread)

    # Section III-G, Eq. (3): at the frontier of what is confident, as far as possible from it.
    normals = trimesh.Trimesh(vertices, SPHERE.faces, process=False).vertex_normals
    confident = u <= CONFIDENT_MAX
    at_frontier = ADJACENT @ confident.astype(float) > 0
    threshold, feasible = CANDIDATE_MIN, np.flatnonzero(at_frontier & (u >= CANDIDATE_MIN))
    while len(feasible) == 0:
        threshold *= 0.8
        feasible = np.flatnonzero(at_frontier & (u >= threshold))
    lengths_m = np.linalg.norm(vertices[EDGES[:, 0]] - vertices[EDGES[:, 1]], axis=1)
    graph = csr_matrix((lengths_m, EDGES.T), shape=(COUNT, COUNT))
    geodesic_m = dijkstra(graph, directed=False, indices=feasible, limit=2 * HOPS * lengths_m.mean())
    counts = RINGS[feasible].multiply(confident[None, :]).toarray().astype(bool) & np.isfinite(geodesic_m)
    mean_m = np.where(counts, geodesic_m, 0.0).sum(axis=1) / np.maximum(counts.sum(axis=1), 1)
    best = feasible[np.argmax(mean_m / max(mean_m.max(), 1e-12) + u[feasible])]
    return vertices[best], normals[best]


def ours(touches):
    """Our step: the attractors and the processor time in milliseconds."""
    root = Path(__file__).resolve().parents[2]
    command = "cargo run --release --quiet -p palpate-core --example contact_step -- paper box".split()
    run = subprocess.run([*command, str(touches), "--attractors"], cwd=root, check=True, capture_output=True, text=True)
    lines = [line.split() for line in run.stdout.splitlines()]
    attractors = np.array([line for line in lines if len(line) == 5 and line[4] in "01"], dtype=float)
    return attractors, min(float(line[-1]) for line in lines[len(attractors):])


def main():
    print("| attractors | Rust, ms | Python, ms | ratio |\n|---|---|---|---|")
    for count in [int(argument) for argument in sys.argv[1:]] or [250, 500, 1000]:
        attractors, rust_ms = ours(count - SEEN)
        points, uncertainty, touched = attractors[:, :3], attractors[:, 3], attractors[:, 4] > 0
        times_ms = []
        for _ in range(8):
            start = time.process_time()
            contact_step(points, uncertainty, touched)
            times_ms.append(1e3 * (time.process_time() - start))
        python_ms = min(times_ms)
        print(f"| {count} | {rust_ms:.1f} | {python_ms:.1f} | {python_ms / rust_ms:.1f} |")


if __name__ == "__main__":
    main()
