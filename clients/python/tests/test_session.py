"""The client that waits, against a real server."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import BALL, CAMERA

import palpate
from palpate import v1

TRUTH = trimesh.creation.icosphere(subdivisions=5, radius=BALL.radius)
TRUTH.apply_translation(BALL.center)


def test_a_ball_is_explored_by_iterating(client: palpate.Client) -> None:
    session = client.create_session(frame_id="base", table_z=0.06, budget=15)
    view = session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA, propose=2)
    assert (view.accepted_points, len(view), view.stop_reason, view.set_aside) == (200, 2, None, {})
    for candidate in session:
        touched = BALL.probe(candidate.start, candidate.end)
        if touched is None:
            session.no_contact(candidate)
        else:
            accepted = session.contact(candidate, touched, force=(0, 0, -2))
            assert accepted.touched_points[0] == pytest.approx(touched, abs=1e-7)
    assert (session.stop_reason, session.stats.attempts) == ("STOP_REASON_BUDGET", 15)
    mesh = session.mesh()
    assert mesh.revision == session.revision == 17
    assert BALL.error_m(mesh.vertices) < 2e-4
    assert mesh.std_m is not None
    assert mesh.vertices.dtype == mesh.std_m.dtype == mesh.uncertainty.dtype == np.float32
    surface = mesh.to_trimesh()
    assert surface.is_watertight
    assert surface.volume == pytest.approx(TRUTH.volume, rel=0.02)
    assert np.shape(surface.vertex_attributes["std_m"]) == (len(mesh.vertices),)
    assert abs(session.evaluate(TRUTH).surface_distance_m - BALL.error_m(mesh.vertices)) < 1e-4


def test_a_candidate_says_all_that_a_robot_needs(session: palpate.Session) -> None:
    best, second = session.candidates(2)
    assert best.start - best.point == pytest.approx(best.point - best.end)
    assert np.cross(best.start - best.end, best.normal) == pytest.approx(0, abs=1e-9)
    # The pad looks into the surface.
    assert best.pad_pose[:3, 2] == pytest.approx(-best.normal)
    assert best.pad_pose[:3, 3] == pytest.approx(best.start)
    assert best.score == pytest.approx(sum(best.terms.values()))
    assert best.why
    assert np.linalg.norm(best.point - second.point) > 0.005


def test_a_pad_on_a_tool_is_where_the_candidate_says(client: palpate.Client) -> None:
    tool_from_pad = ([0.02, 0.0, 0.1], [0.0, 0.0, 0.0, 1.0])
    pads = [palpate.sensor("left", tool_from_pad, pad_half_side_m=0.004, touched_point="pad_center")]
    session = client.create_session(sensors=pads)
    candidate = session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)[0]
    assert candidate.sensor_id == "left"
    assert candidate.pad_pose[:3, 3] == pytest.approx(candidate.start)
    assert candidate.pad_pose[:3, 2] == pytest.approx(-candidate.normal)
    assert not np.allclose(candidate.tool_pose, candidate.pad_pose)
    pose = candidate.pad_pose.copy()
    pose[:3, 3] = candidate.point
    accepted = session.contact(candidate, pose, force=(0, 0, -2))
    (event,) = [event for event in session.events() if event.seq == accepted.seq]
    assert event.contact_result.contact.sensor_id == "left"


def test_each_outcome_is_in_the_log(session: palpate.Session) -> None:
    first = session.candidates()[0]
    reported: list[palpate.Outcome] = [
        palpate.Contact(first.point, force=(0, 0, -2), torque=(0, 0, 0), rest_force=(0, 0, 0.01)),
        palpate.NoContact(sweep_radius_m=0.004),
        palpate.Rejected("NO_IK", "joint 4"),
    ]
    for outcome in reported:
        session.report(session.candidates()[0], outcome, robot_id="arm")
    candidate = session.candidates()[0]
    session.invalid_contact(candidate, candidate.pad_pose, "the housing")
    session.object_moved(([0.0, 0.0, 0.0], [0, 0, 0, 1]), 0.001, "nobody did")
    kinds = [
        event.contact_result.WhichOneof("outcome") for event in session.events() if event.HasField("contact_result")
    ]
    assert kinds == ["contact", "no_contact", "rejected", "invalid_contact", "object_moved"]
    assert [event.contact_result.robot_id for event in session.events() if event.HasField("contact_result")][:3] == [
        "arm"
    ] * 3


def test_what_the_server_doubts_is_a_python_warning_at_the_line_that_called(session: palpate.Session) -> None:
    candidate = session.candidates()[0]
    with pytest.warns(palpate.EvidenceWarning) as warned:
        accepted = session.contact(candidate, candidate.point, force=(0, 0, 2))  # it pulls
    assert "WARNING_CODE_PULLING_FORCE" in [warning.code for warning in accepted.warnings]
    assert warned[0].filename == __file__


def test_wrong_fields_are_named_and_change_nothing(session: palpate.Session) -> None:
    with pytest.raises(palpate.Refused) as refused:
        session.candidates(10_000)
    error = refused.value
    assert (error.code.name, error.reason, list(error.fields)) == ("INVALID_ARGUMENT", "FIELD_INVALID", ["top_k"])
    assert error.hint in str(error)
    revision = session.revision
    with pytest.raises(palpate.Refused, match="uncertainty"):
        session.contact(session.candidates()[0], (0.5, 0, 0.14), uncertainty=7.0)
    assert session.refresh().revision == revision


def test_a_retry_is_counted_once(session: palpate.Session) -> None:
    candidate = session.candidates()[0]
    first = session.no_contact(candidate, request_id="touch-1")
    again = session.no_contact(candidate, request_id="touch-1")
    assert (first.duplicate, again.duplicate) == (False, True)
    assert again.seq == first.seq
    with pytest.raises(palpate.Refused, match="REQUEST_ID_REUSED"):
        session.reject(candidate, "timeout", request_id="touch-1")
    assert session.refresh().stats.attempts == 1


def test_a_loop_that_reports_nothing_is_told_so(session: palpate.Session) -> None:
    loop = iter(session)
    next(loop)
    with pytest.raises(palpate.NotReported):
        next(loop)


def test_a_server_that_is_not_there_is_said_in_words() -> None:
    with pytest.raises(palpate.NoServer, match="is one running there"):
        palpate.Client("http://127.0.0.1:9", connect_timeout=0.5).connect()


def test_a_session_that_is_not_there_is_said_in_words(client: palpate.Client) -> None:
    with pytest.raises(palpate.Refused, match="SESSION_NOT_FOUND"):
        client.session("nobody")


def test_history_forks_and_retractions(client: palpate.Client, session: palpate.Session) -> None:
    before = session.mesh()
    palpate.explore(BALL, session, 4)
    touched = session.mesh()
    fork = session.fork(method="paper", labels={"of": "fork"}, config={"stop": {"max_attempts": 6}})
    assert fork.info.config.method == v1.METHOD_PAPER
    assert fork.info.config.stop.max_attempts == 6
    assert fork.revision == session.revision
    assert fork.mesh().std_m is None
    session.retract(session.revision, "the cable touched")
    assert session.mesh(6).vertices.tobytes() == touched.vertices.tobytes()
    assert session.mesh(2).vertices.tobytes() == before.vertices.tobytes()
    assert all(update.hash_matches for update in session.replay(verify=True))
    session.update(display_name="a ball", labels={"shape": "ball"})
    assert [found.id for found in client.sessions(labels={"shape": "ball"})] == [session.id]
    fork.finish("enough")
    with pytest.raises(palpate.Refused, match="SESSION_FINISHED"):
        fork.no_contact(None, (0, 0, 0), (0, 0, 1))
    fork.delete()
    with pytest.raises(palpate.Refused, match="SESSION_NOT_FOUND"):
        fork.refresh()


def test_series_and_experiments_have_the_true_error(client: palpate.Client) -> None:
    for strategy in ("proactive", "random"):
        session = client.create_session(experiment="balls", strategy=strategy, shadow=["uniform"], table_z=0.06)
        session.add_prior(BALL.seen_from(CAMERA), viewpoint=CAMERA)
        session.set_reference(TRUTH)
        palpate.explore(BALL, session, 5)
        series = session.series()
        assert series["outcome"].tolist()[0] == "view"
        assert np.isfinite(series["surface_distance_m"]).all()
        assert series["surface_distance_m"][-1] < series["surface_distance_m"][0]
        frame = series.to_pandas()
        assert list(frame.index) == [2, 3, 4, 5, 6, 7]
        assert frame["mean_uncertainty"].iloc[-1] < frame["mean_uncertainty"].iloc[0]
        assert session.evaluate().revision == 7
        assert [one.revision for one in session.evaluations([2, 7])] == [2, 7]
    assert "balls" in [experiment.experiment for experiment in client.experiments()]
    summary = client.experiment("balls", by=["strategy"])
    assert [group.n for group in summary.groups] == [1, 1]


def test_files_come_whole_or_not_at_all(client: palpate.Client, session: palpate.Session, tmp_path: Path) -> None:
    palpate.explore(BALL, session, 3)
    for name in ("ball.ply", "ball.stl", "ball.obj", "ball.glb"):
        session.save_mesh(tmp_path / name)
        assert trimesh.load(tmp_path / name, force="mesh").extents == pytest.approx([0.08] * 3, abs=0.02)
    session.export(tmp_path / "ball.tar")
    session.export(tmp_path / "ball.mcap")
    session.export(tmp_path / "ball.csv")
    assert len((tmp_path / "ball.csv").read_text().splitlines()) == 4
    assert (tmp_path / "ball.mcap").read_bytes().startswith(b"\x89MCAP0")
    mesh = session.mesh()
    session.delete()
    assert client.import_session(tmp_path / "ball.tar").id == session.id
    assert client.session(session.id).mesh().vertices.tobytes() == mesh.vertices.tobytes()
    with pytest.raises(palpate.Refused):
        session.export(tmp_path / "late.tar", revision=1000)
    with pytest.raises(ValueError, match="say bundle"):
        session.export(tmp_path / "ball.doc")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "ball.csv", "ball.glb", "ball.mcap", "ball.obj", "ball.ply", "ball.stl", "ball.tar",
    ]  # fmt: skip


def test_a_depth_image_gives_the_same_ball(client: palpate.Client) -> None:
    # A pinhole camera 0.5 m above the ball's centre that looks straight down: rays against the sphere.
    size, focal, above = 120, 500.0, 0.5
    centre = (size - 1) / 2
    columns, rows = np.meshgrid(np.arange(size), np.arange(size))
    rays = np.stack([(columns - centre) / focal, (rows - centre) / focal, np.ones((size, size))], axis=-1)
    a, b, c = (rays**2).sum(-1), -above * rays[..., 2], above**2 - BALL.radius**2
    root = b * b - a * c
    depth = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, 0.0)
    base_from_camera = (np.array(BALL.center) + [0, 0, above], [1.0, 0.0, 0.0, 0.0])
    session = client.create_session()
    session.add_depth((depth * 10_000).round().astype(np.uint16), (focal, focal, centre, centre), base_from_camera,
                      mask=depth > 0, depth_scale_m=1e-4)  # fmt: skip
    top = session.mesh().vertices[:, 2].max()
    assert top == pytest.approx(BALL.center[2] + BALL.radius, abs=1e-3)
    palpate.explore(BALL, session, 12)
    assert BALL.error_m(session.mesh().vertices) < 1e-3


def test_a_watch_has_every_event_once(client: palpate.Client, session: palpate.Session) -> None:
    watch = client.session(session.id).watch(0, include_mesh=True)
    palpate.explore(BALL, session, 2)
    seen, meshes = [], []
    for update in watch:
        if update.event:
            seen.append(update.event.seq)
        if update.mesh:
            meshes.append(update.mesh.revision)
        if meshes and meshes[-1] == 4:
            break
    assert seen == [1, 2, 3, 4]
    assert meshes == [2, 3, 4]
    assert update.session.revision == 4


def test_leases_keep_two_arms_apart(session: palpate.Session) -> None:
    left = session.candidates(robot_id="left", lease_s=30, tool_pose=np.eye(4))[0]
    right = session.candidates(robot_id="right", lease_s=30, keep_out=[palpate.ball((0, 0, 0), 0.1)])[0]
    assert np.linalg.norm(left.point - right.point) > 0.005
    everywhere = palpate.half_space((0, 0, 1), 10.0)
    nothing = session.candidates(keep_out=[everywhere])
    assert len(nothing) == 0
    assert nothing.excluded["keep_out"] > 0


def test_the_server_says_what_it_is(client: palpate.Client) -> None:
    assert client.connect().version
    assert v1.MESH_FORMAT_GLB in client.connect().mesh_formats
