"""Every call: what is sent and how its reply is read. The sync and the asyncio client share all of it.

A function here makes a `Call`; `client.py` and `aio.py` carry it out, each in its own way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from google.protobuf import json_format
from google.protobuf.message import Message

from palpate import v1
from palpate.candidates import (
    Candidate,
    ContactAccepted,
    Proposal,
    ViewAccepted,
    counts,
    points,
    read_warnings,
    stop_reason,
)
from palpate.mesh import Mesh
from palpate.names import count, enum_value
from palpate.poses import PoseLike, VectorLike, pose_message, vector_message
from palpate.retry import new_request_id
from palpate.series import Series

T = TypeVar("T")


@dataclass(frozen=True)
class Call(Generic[T]):
    """One logical call: sent again, it is the same bytes and so the same `request_id`."""

    path: str
    request: Message
    reply: type[Message]
    read: Callable[[Any], T]
    #: The newest revision of its session that is known here: no server answers from an earlier one.
    seen: int = 0

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """What is sent along: the session, by which a proxy before several servers chooses one, and what was seen of it."""
        request: Any = self.request
        session_id = request.session.session_id if isinstance(request, v1.UpdateSessionRequest) else ""
        session_id = session_id or getattr(request, "session_id", "")
        named = (("x-session-id", session_id),) if is_header(session_id) else ()
        return (*named, ("x-min-revision", str(self.seen))) if self.seen else named


def is_header(text: str) -> bool:
    """Whether it can be sent as a header; no session has another id, which the server says better."""
    return bool(text) and text.isascii() and text.isprintable()


def _call(service: str, method: str, request: Message, reply: type[Message], read: Callable[[Any], T]) -> Call[T]:
    return Call(f"/palpate.v1.{service}/{method}", request, reply, read)


def _same(message: Any) -> Any:
    return message


# What a session is made of.


def session_config(
    config: v1.SessionConfig | Mapping[str, Any] | None,
    method: str | None,
    strategy: str | None,
    budget: int | None,
    table_z: float | None,
    sensors: Iterable[v1.Sensor],
    shadow: Iterable[str],
) -> v1.SessionConfig:
    """A configuration from a message or a dictionary of it, with what was said beside it."""
    made = v1.SessionConfig()
    if isinstance(config, v1.SessionConfig):
        made.CopyFrom(config)
    elif config is not None:
        if not isinstance(config, Mapping):
            raise ValueError(
                f"config is a {type(config).__name__}: a SessionConfig or a dictionary of its fields is expected"
            )
        try:
            json_format.ParseDict(dict(config), made)
        except json_format.ParseError as wrong:
            raise ValueError(f"config: {wrong}; SessionConfig in session_config.proto has the fields") from None
    if method is not None:
        made.method = enum_value(v1.Method, method, "method")
    if strategy is not None:
        made.strategy = enum_value(v1.Strategy, strategy, "strategy")
    if budget is not None:
        made.stop.max_attempts = count(budget, "budget")
    if table_z is not None:
        made.support.CopyFrom(v1.HalfSpace(normal=v1.Vector3(z=1.0), offset_m=table_z))
    made.sensors.extend(sensors)
    made.shadow.extend(enum_value(v1.Strategy, name, "shadow") for name in shadow)
    return made


def sensor(
    id: str,
    tool_from_sensor: PoseLike,
    pad_half_side_m: float = 0.0,
    force_noise_n: float | None = None,
    torque_noise_nm: float | None = None,
    touched_point: str | None = None,
) -> v1.Sensor:
    """A pad, for `create_session(sensors=[...])`.

    Args:
        id: what contacts call it.
        tool_from_sensor: where the pad is on the tool: its face's centre, z out of the pad. 4x4 or (position, quaternion).
        pad_half_side_m: half the side of its square face, in metres; 0 = 9 mm.
        force_noise_n, torque_noise_nm: standard deviations of each component, in N and N m; by default 0.05 and 0.0005.
        touched_point: PAD_CENTER for a tip, or CENTER_OF_PRESSURE; by default the method's own choice.
    """
    made = v1.Sensor(
        id=id, tool_from_sensor=pose_message(tool_from_sensor, "tool_from_sensor"), pad_half_side_m=pad_half_side_m
    )
    if force_noise_n is not None:
        made.force_noise_n = force_noise_n
    if torque_noise_nm is not None:
        made.torque_noise_nm = torque_noise_nm
    if touched_point is not None:
        made.touched_point = enum_value(v1.TouchedPoint, touched_point, "touched_point")
    return made


def robot_context(robot_id: str, tool_pose: PoseLike | None, keep_out: Iterable[v1.KeepOut]) -> v1.RobotContext | None:
    """Who asks, and what it must keep away from; `None` where nothing of it is said."""
    context = v1.RobotContext(robot_id=robot_id, keep_out=keep_out)
    if tool_pose is not None:
        context.tool_pose.CopyFrom(pose_message(tool_pose, "tool_pose"))
    return context if context.ByteSize() else None


def half_space(normal: VectorLike, offset_m: float) -> v1.KeepOut:
    """Everything with normal · point < offset_m is to be kept out of; metres, in the session's frame."""
    return v1.KeepOut(half_space=v1.HalfSpace(normal=vector_message(normal, "normal"), offset_m=offset_m))


def ball(center: VectorLike, radius_m: float) -> v1.KeepOut:
    """Everything within `radius_m` of `center` (3,) is to be kept out of; metres, in the session's frame."""
    return v1.KeepOut(ball=v1.Ball(center=vector_message(center, "center"), radius_m=radius_m))


# Sessions.


def create_session(request: v1.CreateSessionRequest) -> Call[v1.Session]:
    request.request_id = request.request_id or new_request_id()
    return _call("SessionService", "CreateSession", request, v1.Session, _same)


def get_session(session_id: str) -> Call[v1.Session]:
    return _call("SessionService", "GetSession", v1.GetSessionRequest(session_id=session_id), v1.Session, _same)


def list_sessions(
    page_token: str, experiment: str, labels: Mapping[str, str] | None, state: str | None
) -> Call[v1.ListSessionsResponse]:
    request = v1.ListSessionsRequest(page_token=page_token, experiment=experiment, labels=labels or {})
    if state is not None:
        request.state = enum_value(v1.SessionState, state, "state")
    return _call("SessionService", "ListSessions", request, v1.ListSessionsResponse, _same)


def update_session(
    session_id: str, etag: str, display_name: str | None, labels: Mapping[str, str] | None
) -> Call[v1.Session]:
    request = v1.UpdateSessionRequest(session=v1.Session(session_id=session_id, etag=etag), request_id=new_request_id())
    if display_name is not None:
        request.session.display_name = display_name
        request.update_mask.paths.append("display_name")
    if labels is not None:
        request.session.labels.update(labels)
        request.update_mask.paths.append("labels")
    return _call("SessionService", "UpdateSession", request, v1.Session, _same)


def finish_session(session_id: str, note: str, request_id: str | None) -> Call[v1.Session]:
    request = v1.FinishSessionRequest(session_id=session_id, note=note, request_id=request_id or new_request_id())
    return _call("SessionService", "FinishSession", request, v1.Session, _same)


def delete_session(session_id: str) -> Call[v1.DeleteSessionResponse]:
    request = v1.DeleteSessionRequest(session_id=session_id, request_id=new_request_id())
    return _call("SessionService", "DeleteSession", request, v1.DeleteSessionResponse, _same)


def fork_session(
    session_id: str,
    revision: int,
    new_session_id: str,
    display_name: str,
    experiment: str,
    labels: Mapping[str, str] | None,
    config: v1.SessionConfig,
    request_id: str | None,
) -> Call[v1.Session]:
    request = v1.ForkSessionRequest(
        session_id=session_id,
        revision=revision,
        new_session_id=new_session_id,
        display_name=display_name,
        experiment=experiment,
        labels=labels or {},
        config=config,
        request_id=request_id or new_request_id(),
    )
    request.config_mask.paths.extend(_paths_set(config))
    return _call("SessionService", "ForkSession", request, v1.Session, _same)


def _paths_set(config: v1.SessionConfig) -> list[str]:
    """The fields that are set, as paths of a field mask; a stop rule is changed number by number."""
    paths = []
    for field, value in config.ListFields():
        if field.name == "stop":
            paths += [f"stop.{inner.name}" for inner, _ in value.ListFields()]
        else:
            paths.append(field.name)
    return paths


def list_experiments(page_token: str) -> Call[v1.ListExperimentsResponse]:
    request = v1.ListExperimentsRequest(page_token=page_token)
    return _call("SessionService", "ListExperiments", request, v1.ListExperimentsResponse, _same)


def summarize_experiment(
    experiment: str, by: Sequence[str], labels: Mapping[str, str] | None
) -> Call[v1.ExperimentSummary]:
    request = v1.SummarizeExperimentRequest(experiment=experiment, by=by, labels=labels or {})
    return _call("SessionService", "SummarizeExperiment", request, v1.ExperimentSummary, _same)


def server_info() -> Call[v1.ServerInfo]:
    return _call("SessionService", "GetServerInfo", v1.GetServerInfoRequest(), v1.ServerInfo, _same)


# The robot's loop. Their replies bring the session as it is after them.


def add_visual_prior(
    session: v1.Session, prior: v1.VisualPrior, propose: int, request_id: str | None
) -> Call[tuple[v1.Session, ViewAccepted]]:
    request = v1.AddVisualPriorRequest(
        session_id=session.session_id,
        prior=prior,
        propose=count(propose, "propose"),
        request_id=request_id or new_request_id(),
    )

    def read(reply: v1.AddVisualPriorResponse) -> tuple[v1.Session, ViewAccepted]:
        return reply.session, ViewAccepted(
            candidates=_candidates(reply.candidates, session),
            revision=reply.session.revision,
            stop_reason=stop_reason(reply.should_stop),
            warnings=read_warnings(reply.warning_details),
            accepted_points=reply.accepted_points,
            dropped_points=reply.dropped_points,
            set_aside=counts(reply.set_aside),
            voxel_m=reply.voxel_m,
        )

    return _call("ExplorationService", "AddVisualPrior", request, v1.AddVisualPriorResponse, read)


def propose_contacts(
    session: v1.Session, k: int, robot: v1.RobotContext | None, lease_s: float | None
) -> Call[Proposal]:
    request = v1.ProposeContactsRequest(session_id=session.session_id, top_k=count(k, "k"), robot=robot)
    if lease_s is not None:
        request.lease.FromNanoseconds(round(1e9 * lease_s))
        request.request_id = new_request_id()

    def read(reply: v1.ProposeContactsResponse) -> Proposal:
        return Proposal(
            candidates=_candidates(reply.candidates, session),
            revision=reply.revision,
            stop_reason=stop_reason(reply.should_stop),
            warnings=read_warnings(reply.warning_details),
            excluded=counts(reply.excluded),
        )

    return _call("ExplorationService", "ProposeContacts", request, v1.ProposeContactsResponse, read)


def report_contact(
    session: v1.Session,
    result: v1.ContactResult,
    propose: int,
    robot: v1.RobotContext | None,
    request_id: str | None,
) -> Call[tuple[v1.Session, ContactAccepted]]:
    request = v1.ReportContactRequest(
        session_id=session.session_id,
        result=result,
        propose=count(propose, "propose"),
        robot=robot,
        request_id=request_id or new_request_id(),
    )

    def read(reply: v1.ReportContactResponse) -> tuple[v1.Session, ContactAccepted]:
        return reply.session, ContactAccepted(
            candidates=_candidates(reply.candidates, session),
            revision=reply.session.revision,
            stop_reason=stop_reason(reply.should_stop),
            warnings=read_warnings(reply.warning_details),
            seq=reply.seq,
            duplicate=reply.duplicate,
            uncertainty=reply.contact_uncertainty,
            touched_points=points(reply.touched_points),
            max_vertex_move_m=reply.max_vertex_move_m,
        )

    return _call("ExplorationService", "ReportContact", request, v1.ReportContactResponse, read)


def retract_event(session_id: str, seq: int, reason: str, request_id: str | None) -> Call[v1.Session]:
    request = v1.RetractEventRequest(
        session_id=session_id, seq=seq, reason=reason, request_id=request_id or new_request_id()
    )
    return _call("ExplorationService", "RetractEvent", request, v1.Session, _same)


def _candidates(messages: Iterable[v1.Candidate], session: v1.Session) -> tuple[Candidate, ...]:
    return tuple(Candidate.read(message, session.config.sensors) for message in messages)


# Reading.


def get_mesh(session_id: str, revision: int) -> Call[Mesh]:
    request = v1.GetMeshRequest(session_id=session_id, revision=revision, format=v1.MESH_FORMAT_RAW)
    return _call("ReconstructionService", "GetMesh", request, v1.Mesh, Mesh.read)


def get_mesh_file(session_id: str, revision: int, format: v1.MeshFormat, colormap: str | None) -> Call[bytes]:
    request = v1.GetMeshRequest(session_id=session_id, revision=revision, format=format)
    if colormap is not None:
        request.colormap = enum_value(v1.Colormap, colormap, "colormap")
    return _call("ReconstructionService", "GetMesh", request, v1.Mesh, lambda mesh: bytes(mesh.file))


def list_events(session_id: str, page_token: str, include_points: bool) -> Call[v1.ListEventsResponse]:
    request = v1.ListEventsRequest(session_id=session_id, page_token=page_token, include_points=include_points)
    return _call("ReconstructionService", "ListEvents", request, v1.ListEventsResponse, _same)


def get_series(session_id: str, after_revision: int) -> Call[Series]:
    request = v1.GetSeriesRequest(session_id=session_id, after_revision=after_revision)
    return _call("ReconstructionService", "GetSeries", request, v1.GetSeriesResponse, Series.read)


def evaluate_session(
    session_id: str, revisions: Sequence[int], mesh: bytes, metres_per_unit: float, samples: int, seed: int
) -> Call[list[v1.Evaluation]]:
    request = v1.EvaluateSessionRequest(
        session_id=session_id,
        revisions=revisions,
        reference_mesh=mesh,
        metres_per_unit=metres_per_unit,
        samples=samples,
        seed=seed,
    )

    def read(reply: v1.EvaluateSessionResponse) -> list[v1.Evaluation]:
        return list(reply.evaluations)

    return _call("ReconstructionService", "EvaluateSession", request, v1.EvaluateSessionResponse, read)


def set_reference(session_id: str, mesh: bytes, metres_per_unit: float) -> Call[v1.Reference]:
    request = v1.SetReferenceRequest(session_id=session_id, mesh=mesh, metres_per_unit=metres_per_unit)
    return _call("ReconstructionService", "SetReference", request, v1.Reference, _same)


# Streams: as calls, but for that many replies come.


def watch_session(session_id: str, after_revision: int, include_mesh: bool) -> Call[v1.WatchSessionResponse]:
    request = v1.WatchSessionRequest(session_id=session_id, after_revision=after_revision, include_mesh=include_mesh)
    return _call("ReconstructionService", "WatchSession", request, v1.WatchSessionResponse, _same)


def replay_session(
    session_id: str, from_revision: int, to_revision: int, include_mesh: bool, verify: bool
) -> Call[v1.WatchSessionResponse]:
    request = v1.ReplaySessionRequest(
        session_id=session_id,
        from_revision=from_revision,
        to_revision=to_revision,
        include_mesh=include_mesh,
        verify=verify,
    )
    return _call("ReconstructionService", "ReplaySession", request, v1.WatchSessionResponse, _same)


def export_session(session_id: str, revision: int, format: v1.ArchiveFormat) -> Call[v1.Chunk]:
    request = v1.ExportSessionRequest(session_id=session_id, revision=revision, format=format)
    return _call("SessionService", "ExportSession", request, v1.Chunk, _same)
