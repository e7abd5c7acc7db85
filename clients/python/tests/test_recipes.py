"""The programs of docs/recipes.md, as they are printed there, against a real server; stand-ins take the place of hardware."""

from __future__ import annotations

import csv
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.poses import quaternion_of
from palpate.simulated import Ball

ROOT = Path(__file__).parents[3]
STAND_INS = Path(__file__).parent / "stand_ins"
# What the server doubts is a failure.
STRICTLY = """
import runpy, sys, warnings, palpate
warnings.simplefilter("error", palpate.EvidenceWarning)
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(heading: str, server: palpate.LocalServer, *arguments: str) -> str:
    """Runs the program under `heading`, with the server's address in place of the usual one; what it printed."""
    command = [str(ROOT / ".ci" / "blocks"), str(ROOT / "docs" / "recipes.md"), heading, "python"]
    text = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    assert text.count("http://127.0.0.1:7257") == 1
    Path("recipe.py").write_text(text.replace("http://127.0.0.1:7257", server.url))
    done = subprocess.run(
        [sys.executable, "-c", STRICTLY, "recipe.py", *arguments],
        env={**os.environ, "PYTHONPATH": str(STAND_INS), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def write_view(ball: Ball, camera: tuple[float, float, float]) -> None:
    """What a camera saw of `ball`, as `view.ply`."""
    points = ball.seen_from(camera)
    header = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    Path("view.ply").write_text(header + "\n".join(" ".join(f"{x:.6f}" for x in point) for point in points) + "\n")


def vertices(path: str) -> np.ndarray:
    """The vertices of a PLY file that the server made."""
    file = Path(path).read_bytes()
    header, body = file.split(b"end_header\n", 1)
    count = int(re.search(rb"element vertex (\d+)", header).group(1))  # type: ignore[union-attr]
    sizes = {b"float": 4, b"uchar": 1}
    stride = sum(sizes[kind] for kind in re.findall(rb"property (\w+) \w+\n", header.split(b"element face")[0]))
    rows = np.frombuffer(body[: count * stride], np.uint8).reshape(count, stride)
    return rows[:, :12].copy().view("<f4").astype(float)


def test_ur_with_rtde(server: palpate.LocalServer) -> None:
    ball = Ball()
    write_view(ball, (0.5, 0.0, 0.6))
    run("UR with RTDE, in Python", server)
    assert ball.error_m(vertices("cup.ply")) < 0.001
    with palpate.Client(server.url) as client:
        stats = client.session("cup-1").stats
        results = [
            event.contact_result for event in client.session("cup-1").events() if event.HasField("contact_result")
        ]
    assert stats.attempts >= 15 and sum(one.HasField("contact") for one in results) >= 10, stats
    # What is out of reach was said to be so, and where it touched the ball pushed back along the pad's axis.
    assert any(one.HasField("rejected") for one in results)
    assert all(-4.0 < one.contact.wrench.force.z < -1.9 for one in results if one.HasField("contact"))


def test_hand_held_with_a_tracker(server: palpate.LocalServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(STAND_INS)
    from hand import CENTER, PROBE_FROM_TIP, RADIUS

    ball = Ball(tuple(CENTER), RADIUS)
    np.savetxt("probe_from_tip.txt", PROBE_FROM_TIP)
    write_view(ball, (0.0, -0.1, 0.5))
    run("A hand-held sensor with a tracker", server)
    assert ball.error_m(vertices("object.ply")) < 0.001


def test_simulation_in_mujoco(server: palpate.LocalServer) -> None:
    run("A simulation in MuJoCo", server)
    share = np.linalg.norm((vertices("object.ply") - [0.5, 0.0, 0.1]) / [0.03, 0.04, 0.05], axis=1)
    assert float(np.abs(share - 1.0).mean()) < 0.02


def test_offline_log_replayed_and_replayed_again(server: palpate.LocalServer) -> None:
    ball, camera, turn = Ball(), (0.5, 0.0, 0.6), np.random.default_rng(3)
    write_view(ball, camera)
    with open("touches.csv", "w", newline="") as table:
        writer = csv.writer(table)
        writer.writerow(["stamp", *"xyz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"])
        for number in range(20):
            out = turn.normal(size=3)
            out[2] = abs(out[2])
            out /= np.linalg.norm(out)
            side = np.cross(out, [1.0, 0.0, 0.0])
            side /= np.linalg.norm(side)
            pose = np.stack([side, np.cross(-out, side), -out], axis=1)
            writer.writerow(
                [1767258000 + number, *(ball.center + ball.radius * out), *quaternion_of(pose), 0, 0, -2, 0, 0, 0]
            )
    first = run("An offline log, replayed", server, "mug-2026-01-01")
    assert first.count("moved the surface") == 20
    assert ball.error_m(vertices("mug-2026-01-01.ply")) < 0.002
    again = run("An offline log, replayed", server, "mug-2026-01-01")
    assert again.count("was known") == 20
    with palpate.Client(server.url) as client:
        session = client.session("mug-2026-01-01")
        assert session.stats.contacts == 20 and session.revision == 22


@pytest.mark.parametrize(
    ("module", "kind"),
    [
        ("rtde_control", "RTDEControlInterface"),
        ("rtde_receive", "RTDEReceiveInterface"),
        ("serial", "Serial"),
        ("sksurgerynditracker.nditracker", "NDITracker"),
    ],
)
def test_what_stands_in_has_the_names_of_the_real_one(module: str, kind: str) -> None:
    real = getattr(importlib.import_module(module), kind)
    assert STAND_INS not in Path(inspect.getfile(sys.modules[module])).parents
    path = STAND_INS / (module.replace(".", "/") + ".py")
    names = re.findall(r"    def (\w+)\(self(?:, )?(.*?)\) ->", path.read_text())
    assert len(names) >= 3
    for name, parameters in names:
        taken = len(re.findall(r"\w+: ", parameters))
        method = getattr(real, name)
        try:
            most = len(inspect.signature(method).parameters) - 1
        except ValueError:
            # pybind11 says what each overload takes in its documentation.
            overloads = re.findall(rf"\b{name}\(self: .*?\) ->", method.__doc__)
            assert overloads, method.__doc__
            most = max(len(re.findall(r"\w+: ", one)) - 1 for one in overloads)
        assert taken <= most, f"{name} takes {most} and not {taken}"
