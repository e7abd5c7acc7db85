from google.protobuf import duration_pb2 as _duration_pb2
from palpate.v1 import candidate_pb2 as _candidate_pb2
from palpate.v1 import contact_pb2 as _contact_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from palpate.v1 import mesh_pb2 as _mesh_pb2
from palpate.v1 import session_pb2 as _session_pb2
from palpate.v1 import session_config_pb2 as _session_config_pb2
from palpate.v1 import stream_pb2 as _stream_pb2
from palpate.v1 import visual_prior_pb2 as _visual_prior_pb2
from palpate.v1 import warning_pb2 as _warning_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class AddVisualPriorRequest(_message.Message):
    __slots__ = ("session_id", "prior", "expected_revision", "request_id", "propose")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    PRIOR_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_REVISION_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    PROPOSE_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    prior: _visual_prior_pb2.VisualPrior
    expected_revision: int
    request_id: str
    propose: int
    def __init__(self, session_id: _Optional[str] = ..., prior: _Optional[_Union[_visual_prior_pb2.VisualPrior, _Mapping]] = ..., expected_revision: _Optional[int] = ..., request_id: _Optional[str] = ..., propose: _Optional[int] = ...) -> None: ...

class AddVisualPriorResponse(_message.Message):
    __slots__ = ("session", "accepted_points", "dropped_points", "candidates", "warnings", "should_stop", "voxel_m", "non_finite_points", "warning_details", "set_aside", "shadow_choices")
    SESSION_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_POINTS_FIELD_NUMBER: _ClassVar[int]
    DROPPED_POINTS_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    WARNINGS_FIELD_NUMBER: _ClassVar[int]
    SHOULD_STOP_FIELD_NUMBER: _ClassVar[int]
    VOXEL_M_FIELD_NUMBER: _ClassVar[int]
    NON_FINITE_POINTS_FIELD_NUMBER: _ClassVar[int]
    WARNING_DETAILS_FIELD_NUMBER: _ClassVar[int]
    SET_ASIDE_FIELD_NUMBER: _ClassVar[int]
    SHADOW_CHOICES_FIELD_NUMBER: _ClassVar[int]
    session: _session_pb2.Session
    accepted_points: int
    dropped_points: int
    candidates: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.Candidate]
    warnings: _containers.RepeatedScalarFieldContainer[str]
    should_stop: _session_pb2.StopReason
    voxel_m: float
    non_finite_points: int
    warning_details: _containers.RepeatedCompositeFieldContainer[_warning_pb2.Warning]
    set_aside: SetAside
    shadow_choices: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.ShadowChoice]
    def __init__(self, session: _Optional[_Union[_session_pb2.Session, _Mapping]] = ..., accepted_points: _Optional[int] = ..., dropped_points: _Optional[int] = ..., candidates: _Optional[_Iterable[_Union[_candidate_pb2.Candidate, _Mapping]]] = ..., warnings: _Optional[_Iterable[str]] = ..., should_stop: _Optional[_Union[_session_pb2.StopReason, str]] = ..., voxel_m: _Optional[float] = ..., non_finite_points: _Optional[int] = ..., warning_details: _Optional[_Iterable[_Union[_warning_pb2.Warning, _Mapping]]] = ..., set_aside: _Optional[_Union[SetAside, _Mapping]] = ..., shadow_choices: _Optional[_Iterable[_Union[_candidate_pb2.ShadowChoice, _Mapping]]] = ...) -> None: ...

class SetAside(_message.Message):
    __slots__ = ("repeated_points", "support_points", "isolated_points", "flying_points", "points_f32_le", "support")
    REPEATED_POINTS_FIELD_NUMBER: _ClassVar[int]
    SUPPORT_POINTS_FIELD_NUMBER: _ClassVar[int]
    ISOLATED_POINTS_FIELD_NUMBER: _ClassVar[int]
    FLYING_POINTS_FIELD_NUMBER: _ClassVar[int]
    POINTS_F32_LE_FIELD_NUMBER: _ClassVar[int]
    SUPPORT_FIELD_NUMBER: _ClassVar[int]
    repeated_points: int
    support_points: int
    isolated_points: int
    flying_points: int
    points_f32_le: bytes
    support: _candidate_pb2.HalfSpace
    def __init__(self, repeated_points: _Optional[int] = ..., support_points: _Optional[int] = ..., isolated_points: _Optional[int] = ..., flying_points: _Optional[int] = ..., points_f32_le: _Optional[bytes] = ..., support: _Optional[_Union[_candidate_pb2.HalfSpace, _Mapping]] = ...) -> None: ...

class ProposeContactsRequest(_message.Message):
    __slots__ = ("session_id", "top_k", "robot", "lease", "request_id", "explain_vertices")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    TOP_K_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    LEASE_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    EXPLAIN_VERTICES_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    top_k: int
    robot: _candidate_pb2.RobotContext
    lease: _duration_pb2.Duration
    request_id: str
    explain_vertices: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, session_id: _Optional[str] = ..., top_k: _Optional[int] = ..., robot: _Optional[_Union[_candidate_pb2.RobotContext, _Mapping]] = ..., lease: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., request_id: _Optional[str] = ..., explain_vertices: _Optional[_Iterable[int]] = ...) -> None: ...

class ProposeContactsResponse(_message.Message):
    __slots__ = ("revision", "candidates", "excluded", "should_stop", "warnings", "warning_details", "explained")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    EXCLUDED_FIELD_NUMBER: _ClassVar[int]
    SHOULD_STOP_FIELD_NUMBER: _ClassVar[int]
    WARNINGS_FIELD_NUMBER: _ClassVar[int]
    WARNING_DETAILS_FIELD_NUMBER: _ClassVar[int]
    EXPLAINED_FIELD_NUMBER: _ClassVar[int]
    revision: int
    candidates: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.Candidate]
    excluded: _candidate_pb2.Excluded
    should_stop: _session_pb2.StopReason
    warnings: _containers.RepeatedScalarFieldContainer[str]
    warning_details: _containers.RepeatedCompositeFieldContainer[_warning_pb2.Warning]
    explained: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.ExplainedVertex]
    def __init__(self, revision: _Optional[int] = ..., candidates: _Optional[_Iterable[_Union[_candidate_pb2.Candidate, _Mapping]]] = ..., excluded: _Optional[_Union[_candidate_pb2.Excluded, _Mapping]] = ..., should_stop: _Optional[_Union[_session_pb2.StopReason, str]] = ..., warnings: _Optional[_Iterable[str]] = ..., warning_details: _Optional[_Iterable[_Union[_warning_pb2.Warning, _Mapping]]] = ..., explained: _Optional[_Iterable[_Union[_candidate_pb2.ExplainedVertex, _Mapping]]] = ...) -> None: ...

class ReportContactRequest(_message.Message):
    __slots__ = ("session_id", "result", "expected_revision", "request_id", "propose", "robot")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    RESULT_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_REVISION_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    PROPOSE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    result: _contact_pb2.ContactResult
    expected_revision: int
    request_id: str
    propose: int
    robot: _candidate_pb2.RobotContext
    def __init__(self, session_id: _Optional[str] = ..., result: _Optional[_Union[_contact_pb2.ContactResult, _Mapping]] = ..., expected_revision: _Optional[int] = ..., request_id: _Optional[str] = ..., propose: _Optional[int] = ..., robot: _Optional[_Union[_candidate_pb2.RobotContext, _Mapping]] = ...) -> None: ...

class ReportContactResponse(_message.Message):
    __slots__ = ("session", "seq", "duplicate", "contact_uncertainty", "max_vertex_move_m", "candidates", "warnings", "should_stop", "warning_details", "touched_points", "touched_point", "shadow_choices")
    SESSION_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    DUPLICATE_FIELD_NUMBER: _ClassVar[int]
    CONTACT_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    MAX_VERTEX_MOVE_M_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    WARNINGS_FIELD_NUMBER: _ClassVar[int]
    SHOULD_STOP_FIELD_NUMBER: _ClassVar[int]
    WARNING_DETAILS_FIELD_NUMBER: _ClassVar[int]
    TOUCHED_POINTS_FIELD_NUMBER: _ClassVar[int]
    TOUCHED_POINT_FIELD_NUMBER: _ClassVar[int]
    SHADOW_CHOICES_FIELD_NUMBER: _ClassVar[int]
    session: _session_pb2.Session
    seq: int
    duplicate: bool
    contact_uncertainty: float
    max_vertex_move_m: float
    candidates: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.Candidate]
    warnings: _containers.RepeatedScalarFieldContainer[str]
    should_stop: _session_pb2.StopReason
    warning_details: _containers.RepeatedCompositeFieldContainer[_warning_pb2.Warning]
    touched_points: _containers.RepeatedCompositeFieldContainer[_geometry_pb2.Vector3]
    touched_point: _session_config_pb2.TouchedPoint
    shadow_choices: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.ShadowChoice]
    def __init__(self, session: _Optional[_Union[_session_pb2.Session, _Mapping]] = ..., seq: _Optional[int] = ..., duplicate: bool = ..., contact_uncertainty: _Optional[float] = ..., max_vertex_move_m: _Optional[float] = ..., candidates: _Optional[_Iterable[_Union[_candidate_pb2.Candidate, _Mapping]]] = ..., warnings: _Optional[_Iterable[str]] = ..., should_stop: _Optional[_Union[_session_pb2.StopReason, str]] = ..., warning_details: _Optional[_Iterable[_Union[_warning_pb2.Warning, _Mapping]]] = ..., touched_points: _Optional[_Iterable[_Union[_geometry_pb2.Vector3, _Mapping]]] = ..., touched_point: _Optional[_Union[_session_config_pb2.TouchedPoint, str]] = ..., shadow_choices: _Optional[_Iterable[_Union[_candidate_pb2.ShadowChoice, _Mapping]]] = ...) -> None: ...

class RetractEventRequest(_message.Message):
    __slots__ = ("session_id", "seq", "reason", "request_id")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    seq: int
    reason: str
    request_id: str
    def __init__(self, session_id: _Optional[str] = ..., seq: _Optional[int] = ..., reason: _Optional[str] = ..., request_id: _Optional[str] = ...) -> None: ...

class ExploreRequest(_message.Message):
    __slots__ = ("id", "request_id", "open", "visual_prior", "result", "propose", "ping")
    ID_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    OPEN_FIELD_NUMBER: _ClassVar[int]
    VISUAL_PRIOR_FIELD_NUMBER: _ClassVar[int]
    RESULT_FIELD_NUMBER: _ClassVar[int]
    PROPOSE_FIELD_NUMBER: _ClassVar[int]
    PING_FIELD_NUMBER: _ClassVar[int]
    id: int
    request_id: str
    open: ExploreOpen
    visual_prior: _visual_prior_pb2.VisualPrior
    result: _contact_pb2.ContactResult
    propose: ProposeContactsRequest
    ping: _stream_pb2.Ping
    def __init__(self, id: _Optional[int] = ..., request_id: _Optional[str] = ..., open: _Optional[_Union[ExploreOpen, _Mapping]] = ..., visual_prior: _Optional[_Union[_visual_prior_pb2.VisualPrior, _Mapping]] = ..., result: _Optional[_Union[_contact_pb2.ContactResult, _Mapping]] = ..., propose: _Optional[_Union[ProposeContactsRequest, _Mapping]] = ..., ping: _Optional[_Union[_stream_pb2.Ping, _Mapping]] = ...) -> None: ...

class ExploreOpen(_message.Message):
    __slots__ = ("session_id", "robot", "top_k", "send_mesh", "resume_after_revision")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    TOP_K_FIELD_NUMBER: _ClassVar[int]
    SEND_MESH_FIELD_NUMBER: _ClassVar[int]
    RESUME_AFTER_REVISION_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    robot: _candidate_pb2.RobotContext
    top_k: int
    send_mesh: bool
    resume_after_revision: int
    def __init__(self, session_id: _Optional[str] = ..., robot: _Optional[_Union[_candidate_pb2.RobotContext, _Mapping]] = ..., top_k: _Optional[int] = ..., send_mesh: bool = ..., resume_after_revision: _Optional[int] = ...) -> None: ...

class ExploreResponse(_message.Message):
    __slots__ = ("in_reply_to", "revision", "opened", "accepted", "prior", "candidates", "mesh", "problem", "pong")
    IN_REPLY_TO_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    OPENED_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    PRIOR_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    MESH_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    PONG_FIELD_NUMBER: _ClassVar[int]
    in_reply_to: int
    revision: int
    opened: _session_pb2.Session
    accepted: ReportContactResponse
    prior: AddVisualPriorResponse
    candidates: ProposeContactsResponse
    mesh: _mesh_pb2.Mesh
    problem: _stream_pb2.Problem
    pong: _stream_pb2.Ping
    def __init__(self, in_reply_to: _Optional[int] = ..., revision: _Optional[int] = ..., opened: _Optional[_Union[_session_pb2.Session, _Mapping]] = ..., accepted: _Optional[_Union[ReportContactResponse, _Mapping]] = ..., prior: _Optional[_Union[AddVisualPriorResponse, _Mapping]] = ..., candidates: _Optional[_Union[ProposeContactsResponse, _Mapping]] = ..., mesh: _Optional[_Union[_mesh_pb2.Mesh, _Mapping]] = ..., problem: _Optional[_Union[_stream_pb2.Problem, _Mapping]] = ..., pong: _Optional[_Union[_stream_pb2.Ping, _Mapping]] = ...) -> None: ...
