# Made by generate.py from aio/session.py: change that.
"""One object that is being explored."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy.typing as npt

from palpate import calls, outcomes, v1, views
from palpate.candidates import Candidate, ContactAccepted, Proposal, ViewAccepted, issue
from palpate.errors import PalpateError, Refused, is_gone_after_retry
from palpate.mesh import SUFFIXES, Mesh, file_bytes
from palpate.outcomes import Contact, InvalidContact, NoContact, ObjectMoved, Outcome, Rejected
from palpate.poses import PoseLike, VectorLike
from palpate.retry import Attempts
from palpate.series import Series
from palpate.session_view import SessionView, next_candidate
from palpate.streams import Saving, Update, Watching, archive_format

if TYPE_CHECKING:
    from palpate.client import Client

T = TypeVar("T")


class Session(SessionView):
    """A session on a server; `Client.create_session` and `Client.session` make one.

    All points and poses are in the session's one frame, lengths are metres, forces newtons.
    Whatever changes the session returns when it is on the server's disk.
    Iterating asks for the next touch until the server advises to stop; report each before the next one.

    Every method may raise `Refused` (the server said no, and nothing was changed) and `NoAnswer`.
    """

    def __init__(self, client: Client, info: v1.Session):
        super().__init__(info)
        self._client = client

    # Evidence and questions.

    def add_prior(
        self,
        points: npt.ArrayLike | str | Path,
        viewpoint: VectorLike | None = None,
        *,
        voxel_m: float | None = None,
        uncertainty: float | None = None,
        keep_clutter: bool = False,
        propose: int = 1,
        request_id: str | None = None,
    ) -> ViewAccepted:
        """Adds a camera's view as a cloud. The first view makes the session active.

        Args:
            points: (N, 3) floats in metres; or the path of a PLY or PCD file. Rows with a NaN are dropped.
            viewpoint: (3,) where the camera was: tells on which side of the points the object is.
            voxel_m: edge of the voxels of which each gives one point.
            uncertainty: of these points, in [0, 1]; by default 0.1.
            keep_clutter: keep points of the table, lone ones and those at a depth edge, which are set aside otherwise.
            propose: how many candidates the answer is to bring.

        Raises:
            ValueError: the array's shape or type is wrong.
            Refused: FIELD_INVALID, NON_FINITE, TOO_LARGE, SESSION_FINISHED.
        """
        prior = views.cloud(points, viewpoint, voxel_m, uncertainty, keep_clutter)
        return self._add_view(prior, propose, request_id)

    def add_depth(
        self,
        depth: npt.ArrayLike,
        intrinsics: npt.ArrayLike,
        base_from_camera: PoseLike,
        *,
        mask: npt.ArrayLike | None = None,
        depth_scale_m: float = 0.001,
        depth_range_m: tuple[float, float] | None = None,
        voxel_m: float | None = None,
        uncertainty: float | None = None,
        keep_clutter: bool = False,
        propose: int = 1,
        request_id: str | None = None,
    ) -> ViewAccepted:
        """Adds a camera's view as a depth image.

        Args:
            depth: (rows, columns) 16-bit units along the optical axis; 0 = no measurement.
            intrinsics: (fx, fy, cx, cy) or the 3x3 camera matrix, in pixels.
            base_from_camera: pose of the camera's optical frame (x right, y down, z forward) in the session's frame, 4x4
                or (position, quaternion).
            mask: (rows, columns), not 0 where the object is; by default the whole image.
            depth_scale_m: metres of one unit; by default millimetres.
            depth_range_m: nearest and farthest depth that is kept, in metres.
            voxel_m, uncertainty, keep_clutter, propose: as in `add_prior`.

        Raises:
            ValueError: a shape or type is wrong.
            Refused: as in `add_prior`.
        """
        prior = views.depth_image(
            depth, intrinsics, base_from_camera, mask, depth_scale_m, depth_range_m, voxel_m, uncertainty, keep_clutter
        )
        return self._add_view(prior, propose, request_id)

    def _add_view(self, prior: v1.VisualPrior, propose: int, request_id: str | None) -> ViewAccepted:
        self._info, accepted = self._run(calls.add_visual_prior(self._info, prior, propose, request_id))
        issue(accepted.warnings)
        return accepted

    def candidates(
        self,
        k: int = 1,
        *,
        robot_id: str = "",
        tool_pose: PoseLike | None = None,
        keep_out: Iterable[v1.KeepOut] = (),
        lease_s: float | None = None,
    ) -> Proposal:
        """The best places to touch next, best first. That there is none is no error: `stop_reason` and `excluded` say why.

        Args:
            k: how many; the others are alternatives to the first, apart from it.
            robot_id: who asks.
            tool_pose: where its tool is, for strategies that weigh the way.
            keep_out: what is in the way now: `palpate.half_space` and `palpate.ball`.
            lease_s: keep the places from other robots for so many seconds; needs `robot_id`.
        """
        robot = calls.robot_context(robot_id, tool_pose, keep_out)
        proposal = self._run(calls.propose_contacts(self._info, k, robot, lease_s))
        issue(proposal.warnings)
        return proposal

    def __iter__(self) -> Iterator[Candidate]:
        """The next places to touch, one at a time, until the server advises to stop or has none.

        Raises:
            NotReported: the one before was not reported.
        """
        last_revision = None
        while next_candidate(proposal := self.candidates(), last_revision):
            last_revision = proposal.revision
            yield proposal[0]

    def report(
        self,
        candidate: Candidate | None,
        outcome: Outcome,
        *,
        robot_id: str = "",
        observe_time: datetime | None = None,
        propose: int = 1,
        request_id: str | None = None,
    ) -> ContactAccepted:
        """Reports what came of an approach; `contact`, `no_contact` and the others are shorthands for it.

        Args:
            candidate: what was approached; `None` for a touch that nobody proposed.
            outcome: a `Contact`, several (of several pads at once), `NoContact`, `InvalidContact`, `Rejected` or
                `ObjectMoved`; `None` = no contact on the candidate's whole way.
            robot_id: who touched.
            observe_time: when, by the caller's clock.
            propose: how many candidates the answer is to bring.
            request_id: makes a retry safe after this program was restarted; by default one is made.
        """
        result = outcomes.result(candidate, outcome, robot_id, observe_time)
        robot = calls.robot_context(robot_id, None, ())
        self._info, accepted = self._run(calls.report_contact(self._info, result, propose, robot, request_id))
        issue(accepted.warnings)
        return accepted

    def contact(
        self,
        candidate: Candidate | None,
        pose: PoseLike | VectorLike,
        force: VectorLike | None = None,
        torque: VectorLike | None = None,
        **more: Any,
    ) -> ContactAccepted:
        """Reports that the pad touched.

        Args:
            pose, force, torque: as in `Contact`: 4x4, (position, quaternion) or a position alone; N and N m in the
                sensor's frame.
            more: any other attribute of `Contact`, and any other argument of `report`.
        """
        of_contact = {name: more.pop(name) for name in list(more) if name in Contact.__dataclass_fields__}
        return self.report(candidate, Contact(pose, force, torque, **of_contact), **more)

    def no_contact(
        self,
        candidate: Candidate | None,
        swept_from: VectorLike | None = None,
        swept_to: VectorLike | None = None,
        *,
        sweep_radius_m: float = 0.0,
        **more: Any,
    ) -> ContactAccepted:
        """Reports that the approach touched nothing; by default all the way from the candidate's start to its end.

        Args:
            swept_from, swept_to, sweep_radius_m: as in `NoContact`.
            more: any other argument of `report`.
        """
        return self.report(candidate, NoContact(swept_from, swept_to, sweep_radius_m), **more)

    def invalid_contact(
        self, candidate: Candidate | None, pose: PoseLike | VectorLike, detail: str = "", **more: Any
    ) -> ContactAccepted:
        """Reports that something else than the pad's face touched.

        Args:
            pose, detail: as in `InvalidContact`.
            more: any other argument of `report`.
        """
        return self.report(candidate, InvalidContact(pose, detail), **more)

    def reject(self, candidate: Candidate, reason: str, detail: str = "", **more: Any) -> ContactAccepted:
        """Reports that the approach was not made; the next candidate is another place.

        Args:
            reason: NO_IK, COLLISION, SAFETY_STOP, TIMEOUT or OPERATOR.
            detail: what the robot knows of it.
            more: any other argument of `report`.
        """
        return self.report(candidate, Rejected(reason, detail), **more)

    def object_moved(
        self, new_from_old: PoseLike, std_m: float = 0.0, detail: str = "", **more: Any
    ) -> ContactAccepted:
        """Reports that the object was pushed: what was known moves with it.

        Args:
            new_from_old, std_m, detail: as in `ObjectMoved`.
            more: any other argument of `report`.
        """
        return self.report(None, ObjectMoved(new_from_old, std_m, detail), **more)

    def retract(self, seq: int, reason: str = "", *, request_id: str | None = None) -> None:
        """Takes a view or a touch out of the estimate, as if it had never been reported; the log keeps it.

        Args:
            seq: number of the event, as in `ContactAccepted.seq`.
            reason: why.
        """
        self._info = self._run(calls.retract_event(self.id, seq, reason, request_id))

    # What it has become.

    def refresh(self) -> Session:
        """Reads the session again, which others may have changed."""
        self._info = self._run(calls.get_session(self.id))
        return self

    def mesh(self, revision: int | None = None) -> Mesh:
        """The estimated surface, with its uncertainty, at any revision; by default the newest.

        Raises:
            Refused: NO_VISUAL_PRIOR where there is none yet, FIELD_INVALID for a revision that is not there.
        """
        return self._run(calls.get_mesh(self.id, revision or 0))

    def save_mesh(self, path: str | Path, revision: int | None = None, *, colormap: str | None = None) -> None:
        """Writes the estimated surface as a file: PLY, OBJ, STL or GLB, by the name's suffix.

        Args:
            colormap: PAPER or CIVIDIS, for GLB.
        """
        where = Path(path)
        format = SUFFIXES.get(where.suffix.lower())
        if format is None:
            raise ValueError(f"path is {where.name}: a mesh is written as {', '.join(SUFFIXES)}")
        file = self._run(calls.get_mesh_file(self.id, revision or 0, format, colormap))
        where.write_bytes(file)

    def events(self, *, include_points: bool = False) -> Iterator[v1.Event]:
        """The session's log, oldest event first.

        Args:
            include_points: with the bytes of the views.
        """
        token = ""
        while True:
            page = self._run(calls.list_events(self.id, token, include_points))
            for event in page.events:
                yield event
            token = page.next_page_token
            if not token:
                return

    def series(self, after_revision: int = 0, *, wait: bool = True) -> Series:
        """One row for each view and attempt.

        Args:
            after_revision: only rows after it.
            wait: until the distances from the reference are computed, if the session keeps one.
        """
        while True:
            series = self._run(calls.get_series(self.id, after_revision))
            if not wait or not series.errors_pending:
                return series
            time.sleep(0.1)

    def evaluate(
        self,
        mesh: Any = None,
        revision: int | None = None,
        *,
        metres_per_unit: float = 0.0,
        samples: int = 0,
        seed: int = 0,
    ) -> v1.Evaluation:
        """How near the estimate is to the true surface: `surface_distance_m`, `hausdorff_m`, `f_score_1mm`, ...

        Args:
            mesh: the true surface in the session's frame: the path or the bytes of a PLY, STL or OBJ file, or a trimesh;
                by default the one that `set_reference` keeps.
            revision: by default the newest.
            metres_per_unit: of the file; 0 = 1.
            samples: of each surface, for the chamfer distance; 0 = 13,000.
            seed: of the sampling.

        Raises:
            Refused: NO_REFERENCE, NO_VISUAL_PRIOR.
        """
        evaluations = self.evaluations(
            [revision or 0], mesh, metres_per_unit=metres_per_unit, samples=samples, seed=seed
        )
        return evaluations[0]

    def evaluations(
        self,
        revisions: Sequence[int],
        mesh: Any = None,
        *,
        metres_per_unit: float = 0.0,
        samples: int = 0,
        seed: int = 0,
    ) -> list[v1.Evaluation]:
        """As `evaluate`, of up to 64 revisions at once."""
        file = b"" if mesh is None else file_bytes(mesh)
        return self._run(calls.evaluate_session(self.id, revisions, file, metres_per_unit, samples, seed))

    def set_reference(self, mesh: Any, metres_per_unit: float = 0.0) -> None:
        """Keeps the true surface with the session, for its series and its experiment; the estimate does not know of it.

        Args:
            mesh, metres_per_unit: as in `evaluate`.
        """
        self._run(calls.set_reference(self.id, file_bytes(mesh), metres_per_unit))

    # Its steps, and its end.

    def watch(self, after_revision: int | None = None, *, include_mesh: bool = False) -> Iterator[Update]:
        """Follows the session: each event once and in order, across broken connections. It ends when nothing more comes.

        Args:
            after_revision: where to begin; by default after what this object knows. 0 = from the creation on.
            include_mesh: an update with the mesh after each event that changed it.
        """
        watching = Watching(self.id, self.revision if after_revision is None else after_revision, include_mesh)
        attempts = Attempts(self._client.timeout)
        while True:
            try:
                for reply in self._client.stream(self._seen(watching.call())):
                    attempts = Attempts(self._client.timeout)
                    if update := watching.read(reply):
                        yield update
                return
            except PalpateError as error:
                time.sleep(attempts.wait_after(error))

    def replay(
        self, from_revision: int = 0, to_revision: int = 0, *, include_mesh: bool = False, verify: bool = False
    ) -> Iterator[Update]:
        """Shows every step again, and with `verify` computes each anew and says whether it is the recorded one."""
        call = calls.replay_session(self.id, from_revision, to_revision, include_mesh, verify)
        for reply in self._client.stream(self._seen(call)):
            if update := Update.read(reply):
                yield update

    def fork(
        self,
        revision: int | None = None,
        session_id: str = "",
        *,
        display_name: str = "",
        experiment: str = "",
        labels: Mapping[str, str] | None = None,
        method: str | None = None,
        strategy: str | None = None,
        budget: int | None = None,
        config: v1.SessionConfig | Mapping[str, Any] | None = None,
        request_id: str | None = None,
    ) -> Session:
        """Copies the session up to a revision, under another configuration if wanted: the same touches, computed anew.

        Args:
            revision: the last one that is copied; by default the newest.
            session_id: of the copy; by default the server makes one.
            display_name, experiment: of the copy; by default the same.
            labels: in addition to the session's own.
            method, strategy, budget, config: what is to be different, as in `Client.create_session`.
        """
        changed = calls.session_config(config, method, strategy, budget, None, (), ())
        call = calls.fork_session(
            self.id, revision or 0, session_id, display_name, experiment, labels, changed, request_id
        )
        return Session(self._client, self._run(call))

    def export(self, path: str | Path, format: str | None = None, revision: int | None = None) -> None:
        """Writes the whole session as a file.

        Args:
            format: bundle (all of it, for `Client.import_session`), mcap (for Foxglove) or csv (a row for each
                attempt); by default by the suffix: .tar, .mcap or .csv.
            revision: up to which; by default the newest.
        """
        call = calls.export_session(self.id, revision or 0, archive_format(Path(path), format))
        with Saving(Path(path)) as saving:
            for chunk in self._client.stream(self._seen(call)):
                saving.write(chunk)

    def update(self, *, display_name: str | None = None, labels: Mapping[str, str] | None = None) -> None:
        """Changes what people call the session.

        Raises:
            Refused: ETAG_MISMATCH, when somebody else changed it since this object read it: `refresh`, and decide.
        """
        self._info = self._run(calls.update_session(self.id, self._info.etag, display_name, labels))

    def finish(self, note: str = "", *, request_id: str | None = None) -> None:
        """Closes the session: it stays readable, and can be forked."""
        self._info = self._run(calls.finish_session(self.id, note, request_id))

    def delete(self) -> None:
        """Removes the session with all its events, for good."""
        try:
            self._client.run(calls.delete_session(self.id))
        except Refused as error:
            if not is_gone_after_retry(error):
                raise

    def _run(self, call: calls.Call[T]) -> T:
        return self._client.run(self._seen(call))

    def _seen(self, call: calls.Call[T]) -> calls.Call[T]:
        # Behind a proxy the next call may reach a server that has not heard yet what this one was told.
        return replace(call, seen=self.revision)
