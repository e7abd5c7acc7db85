from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import candidate_pb2 as _candidate_pb2
from palpate.v1 import event_pb2 as _event_pb2
from palpate.v1 import mesh_pb2 as _mesh_pb2
from palpate.v1 import session_pb2 as _session_pb2
from palpate.v1 import stream_pb2 as _stream_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class GetMeshRequest(_message.Message):
    __slots__ = ("session_id", "revision", "format", "if_none_match", "have_topology", "colormap")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    IF_NONE_MATCH_FIELD_NUMBER: _ClassVar[int]
    HAVE_TOPOLOGY_FIELD_NUMBER: _ClassVar[int]
    COLORMAP_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    revision: int
    format: _mesh_pb2.MeshFormat
    if_none_match: str
    have_topology: str
    colormap: _mesh_pb2.Colormap
    def __init__(self, session_id: _Optional[str] = ..., revision: _Optional[int] = ..., format: _Optional[_Union[_mesh_pb2.MeshFormat, str]] = ..., if_none_match: _Optional[str] = ..., have_topology: _Optional[str] = ..., colormap: _Optional[_Union[_mesh_pb2.Colormap, str]] = ...) -> None: ...

class ListEventsRequest(_message.Message):
    __slots__ = ("session_id", "page_size", "page_token", "include_points")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_POINTS_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    page_size: int
    page_token: str
    include_points: bool
    def __init__(self, session_id: _Optional[str] = ..., page_size: _Optional[int] = ..., page_token: _Optional[str] = ..., include_points: bool = ...) -> None: ...

class ListEventsResponse(_message.Message):
    __slots__ = ("events", "next_page_token")
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    events: _containers.RepeatedCompositeFieldContainer[_event_pb2.Event]
    next_page_token: str
    def __init__(self, events: _Optional[_Iterable[_Union[_event_pb2.Event, _Mapping]]] = ..., next_page_token: _Optional[str] = ...) -> None: ...

class WatchSessionRequest(_message.Message):
    __slots__ = ("session_id", "after_revision", "include_mesh", "heartbeat")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    AFTER_REVISION_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_MESH_FIELD_NUMBER: _ClassVar[int]
    HEARTBEAT_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    after_revision: int
    include_mesh: bool
    heartbeat: _duration_pb2.Duration
    def __init__(self, session_id: _Optional[str] = ..., after_revision: _Optional[int] = ..., include_mesh: bool = ..., heartbeat: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ...) -> None: ...

class WatchSessionResponse(_message.Message):
    __slots__ = ("event", "mesh", "heartbeat", "session", "candidates", "hash_matches")
    EVENT_FIELD_NUMBER: _ClassVar[int]
    MESH_FIELD_NUMBER: _ClassVar[int]
    HEARTBEAT_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    HASH_MATCHES_FIELD_NUMBER: _ClassVar[int]
    event: _event_pb2.Event
    mesh: _mesh_pb2.Mesh
    heartbeat: _stream_pb2.Ping
    session: _session_pb2.Session
    candidates: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.Candidate]
    hash_matches: bool
    def __init__(self, event: _Optional[_Union[_event_pb2.Event, _Mapping]] = ..., mesh: _Optional[_Union[_mesh_pb2.Mesh, _Mapping]] = ..., heartbeat: _Optional[_Union[_stream_pb2.Ping, _Mapping]] = ..., session: _Optional[_Union[_session_pb2.Session, _Mapping]] = ..., candidates: _Optional[_Iterable[_Union[_candidate_pb2.Candidate, _Mapping]]] = ..., hash_matches: bool = ...) -> None: ...

class ReplaySessionRequest(_message.Message):
    __slots__ = ("session_id", "from_revision", "to_revision", "include_mesh", "verify")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    FROM_REVISION_FIELD_NUMBER: _ClassVar[int]
    TO_REVISION_FIELD_NUMBER: _ClassVar[int]
    INCLUDE_MESH_FIELD_NUMBER: _ClassVar[int]
    VERIFY_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    from_revision: int
    to_revision: int
    include_mesh: bool
    verify: bool
    def __init__(self, session_id: _Optional[str] = ..., from_revision: _Optional[int] = ..., to_revision: _Optional[int] = ..., include_mesh: bool = ..., verify: bool = ...) -> None: ...

class EvaluateSessionRequest(_message.Message):
    __slots__ = ("session_id", "revisions", "reference_mesh", "reference_format", "samples", "seed", "metres_per_unit", "keep_reference")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    REVISIONS_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_MESH_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FORMAT_FIELD_NUMBER: _ClassVar[int]
    SAMPLES_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    METRES_PER_UNIT_FIELD_NUMBER: _ClassVar[int]
    KEEP_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    revisions: _containers.RepeatedScalarFieldContainer[int]
    reference_mesh: bytes
    reference_format: _mesh_pb2.MeshFormat
    samples: int
    seed: int
    metres_per_unit: float
    keep_reference: bool
    def __init__(self, session_id: _Optional[str] = ..., revisions: _Optional[_Iterable[int]] = ..., reference_mesh: _Optional[bytes] = ..., reference_format: _Optional[_Union[_mesh_pb2.MeshFormat, str]] = ..., samples: _Optional[int] = ..., seed: _Optional[int] = ..., metres_per_unit: _Optional[float] = ..., keep_reference: bool = ...) -> None: ...

class EvaluateSessionResponse(_message.Message):
    __slots__ = ("evaluations",)
    EVALUATIONS_FIELD_NUMBER: _ClassVar[int]
    evaluations: _containers.RepeatedCompositeFieldContainer[Evaluation]
    def __init__(self, evaluations: _Optional[_Iterable[_Union[Evaluation, _Mapping]]] = ...) -> None: ...

class Evaluation(_message.Message):
    __slots__ = ("revision", "surface_distance_m", "chamfer_sum_m", "chamfer_mean_m", "hausdorff_m", "f_score_1mm", "coverage", "volume_ratio", "failures", "calibration_2sigma", "calibration_1sigma", "has_calibration", "early_contacts", "no_contacts", "rejected", "invalid_contacts", "attempts", "chamfer_floor_m")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SURFACE_DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    CHAMFER_SUM_M_FIELD_NUMBER: _ClassVar[int]
    CHAMFER_MEAN_M_FIELD_NUMBER: _ClassVar[int]
    HAUSDORFF_M_FIELD_NUMBER: _ClassVar[int]
    F_SCORE_1MM_FIELD_NUMBER: _ClassVar[int]
    COVERAGE_FIELD_NUMBER: _ClassVar[int]
    VOLUME_RATIO_FIELD_NUMBER: _ClassVar[int]
    FAILURES_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_2SIGMA_FIELD_NUMBER: _ClassVar[int]
    CALIBRATION_1SIGMA_FIELD_NUMBER: _ClassVar[int]
    HAS_CALIBRATION_FIELD_NUMBER: _ClassVar[int]
    EARLY_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    NO_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    REJECTED_FIELD_NUMBER: _ClassVar[int]
    INVALID_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    ATTEMPTS_FIELD_NUMBER: _ClassVar[int]
    CHAMFER_FLOOR_M_FIELD_NUMBER: _ClassVar[int]
    revision: int
    surface_distance_m: float
    chamfer_sum_m: float
    chamfer_mean_m: float
    hausdorff_m: float
    f_score_1mm: float
    coverage: float
    volume_ratio: float
    failures: int
    calibration_2sigma: float
    calibration_1sigma: float
    has_calibration: bool
    early_contacts: int
    no_contacts: int
    rejected: int
    invalid_contacts: int
    attempts: int
    chamfer_floor_m: float
    def __init__(self, revision: _Optional[int] = ..., surface_distance_m: _Optional[float] = ..., chamfer_sum_m: _Optional[float] = ..., chamfer_mean_m: _Optional[float] = ..., hausdorff_m: _Optional[float] = ..., f_score_1mm: _Optional[float] = ..., coverage: _Optional[float] = ..., volume_ratio: _Optional[float] = ..., failures: _Optional[int] = ..., calibration_2sigma: _Optional[float] = ..., calibration_1sigma: _Optional[float] = ..., has_calibration: bool = ..., early_contacts: _Optional[int] = ..., no_contacts: _Optional[int] = ..., rejected: _Optional[int] = ..., invalid_contacts: _Optional[int] = ..., attempts: _Optional[int] = ..., chamfer_floor_m: _Optional[float] = ...) -> None: ...

class GetSeriesRequest(_message.Message):
    __slots__ = ("session_id", "after_revision", "without_shadow")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    AFTER_REVISION_FIELD_NUMBER: _ClassVar[int]
    WITHOUT_SHADOW_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    after_revision: int
    without_shadow: bool
    def __init__(self, session_id: _Optional[str] = ..., after_revision: _Optional[int] = ..., without_shadow: bool = ...) -> None: ...

class GetSeriesResponse(_message.Message):
    __slots__ = ("rows", "revision", "reference_sha256", "errors_pending")
    ROWS_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_SHA256_FIELD_NUMBER: _ClassVar[int]
    ERRORS_PENDING_FIELD_NUMBER: _ClassVar[int]
    rows: _containers.RepeatedCompositeFieldContainer[SeriesRow]
    revision: int
    reference_sha256: str
    errors_pending: int
    def __init__(self, rows: _Optional[_Iterable[_Union[SeriesRow, _Mapping]]] = ..., revision: _Optional[int] = ..., reference_sha256: _Optional[str] = ..., errors_pending: _Optional[int] = ...) -> None: ...

class SeriesRow(_message.Message):
    __slots__ = ("revision", "attempt", "append_time", "outcome", "candidate_id", "robot_id", "mean_uncertainty", "max_uncertainty", "mean_std_m", "failures", "surface_distance_m", "force_n", "duration", "doubted", "retracted_by_seq", "shadow_choices")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ATTEMPT_FIELD_NUMBER: _ClassVar[int]
    APPEND_TIME_FIELD_NUMBER: _ClassVar[int]
    OUTCOME_FIELD_NUMBER: _ClassVar[int]
    CANDIDATE_ID_FIELD_NUMBER: _ClassVar[int]
    ROBOT_ID_FIELD_NUMBER: _ClassVar[int]
    MEAN_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    MAX_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    MEAN_STD_M_FIELD_NUMBER: _ClassVar[int]
    FAILURES_FIELD_NUMBER: _ClassVar[int]
    SURFACE_DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    FORCE_N_FIELD_NUMBER: _ClassVar[int]
    DURATION_FIELD_NUMBER: _ClassVar[int]
    DOUBTED_FIELD_NUMBER: _ClassVar[int]
    RETRACTED_BY_SEQ_FIELD_NUMBER: _ClassVar[int]
    SHADOW_CHOICES_FIELD_NUMBER: _ClassVar[int]
    revision: int
    attempt: int
    append_time: _timestamp_pb2.Timestamp
    outcome: str
    candidate_id: str
    robot_id: str
    mean_uncertainty: float
    max_uncertainty: float
    mean_std_m: float
    failures: int
    surface_distance_m: float
    force_n: float
    duration: _duration_pb2.Duration
    doubted: bool
    retracted_by_seq: int
    shadow_choices: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.ShadowChoice]
    def __init__(self, revision: _Optional[int] = ..., attempt: _Optional[int] = ..., append_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., outcome: _Optional[str] = ..., candidate_id: _Optional[str] = ..., robot_id: _Optional[str] = ..., mean_uncertainty: _Optional[float] = ..., max_uncertainty: _Optional[float] = ..., mean_std_m: _Optional[float] = ..., failures: _Optional[int] = ..., surface_distance_m: _Optional[float] = ..., force_n: _Optional[float] = ..., duration: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., doubted: bool = ..., retracted_by_seq: _Optional[int] = ..., shadow_choices: _Optional[_Iterable[_Union[_candidate_pb2.ShadowChoice, _Mapping]]] = ...) -> None: ...

class SetReferenceRequest(_message.Message):
    __slots__ = ("session_id", "mesh", "format", "metres_per_unit")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    MESH_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    METRES_PER_UNIT_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    mesh: bytes
    format: _mesh_pb2.MeshFormat
    metres_per_unit: float
    def __init__(self, session_id: _Optional[str] = ..., mesh: _Optional[bytes] = ..., format: _Optional[_Union[_mesh_pb2.MeshFormat, str]] = ..., metres_per_unit: _Optional[float] = ...) -> None: ...

class GetReferenceRequest(_message.Message):
    __slots__ = ("session_id", "without_mesh")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    WITHOUT_MESH_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    without_mesh: bool
    def __init__(self, session_id: _Optional[str] = ..., without_mesh: bool = ...) -> None: ...

class Reference(_message.Message):
    __slots__ = ("sha256", "mesh", "format", "metres_per_unit", "n_vertices", "n_faces")
    SHA256_FIELD_NUMBER: _ClassVar[int]
    MESH_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    METRES_PER_UNIT_FIELD_NUMBER: _ClassVar[int]
    N_VERTICES_FIELD_NUMBER: _ClassVar[int]
    N_FACES_FIELD_NUMBER: _ClassVar[int]
    sha256: str
    mesh: bytes
    format: _mesh_pb2.MeshFormat
    metres_per_unit: float
    n_vertices: int
    n_faces: int
    def __init__(self, sha256: _Optional[str] = ..., mesh: _Optional[bytes] = ..., format: _Optional[_Union[_mesh_pb2.MeshFormat, str]] = ..., metres_per_unit: _Optional[float] = ..., n_vertices: _Optional[int] = ..., n_faces: _Optional[int] = ...) -> None: ...

class DeleteReferenceRequest(_message.Message):
    __slots__ = ("session_id",)
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    def __init__(self, session_id: _Optional[str] = ...) -> None: ...

class DeleteReferenceResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...
