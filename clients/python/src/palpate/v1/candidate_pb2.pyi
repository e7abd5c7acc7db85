from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from palpate.v1 import strategy_pb2 as _strategy_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Hindsight(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    HINDSIGHT_UNSPECIFIED: _ClassVar[Hindsight]
    HINDSIGHT_HIT: _ClassVar[Hindsight]
    HINDSIGHT_MISS: _ClassVar[Hindsight]
    HINDSIGHT_EARLY: _ClassVar[Hindsight]

class Exclusion(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    EXCLUSION_UNSPECIFIED: _ClassVar[Exclusion]
    EXCLUSION_ALREADY_CERTAIN: _ClassVar[Exclusion]
    EXCLUSION_NO_CONFIDENT_NEIGHBOUR: _ClassVar[Exclusion]
    EXCLUSION_KEEP_OUT: _ClassVar[Exclusion]
    EXCLUSION_LEASED: _ClassVar[Exclusion]
    EXCLUSION_RECENTLY_FAILED: _ClassVar[Exclusion]
    EXCLUSION_UNREACHABLE: _ClassVar[Exclusion]
    EXCLUSION_NOT_COMPARED: _ClassVar[Exclusion]
HINDSIGHT_UNSPECIFIED: Hindsight
HINDSIGHT_HIT: Hindsight
HINDSIGHT_MISS: Hindsight
HINDSIGHT_EARLY: Hindsight
EXCLUSION_UNSPECIFIED: Exclusion
EXCLUSION_ALREADY_CERTAIN: Exclusion
EXCLUSION_NO_CONFIDENT_NEIGHBOUR: Exclusion
EXCLUSION_KEEP_OUT: Exclusion
EXCLUSION_LEASED: Exclusion
EXCLUSION_RECENTLY_FAILED: Exclusion
EXCLUSION_UNREACHABLE: Exclusion
EXCLUSION_NOT_COMPARED: Exclusion

class Candidate(_message.Message):
    __slots__ = ("candidate_id", "vertex", "point", "normal", "probe_start", "probe_end", "score", "terms", "uncertainty", "std_m", "mean_geodesic_m", "failure_risk", "sensor_id", "tool_pose", "relaxed", "why", "lease_expire_time")
    CANDIDATE_ID_FIELD_NUMBER: _ClassVar[int]
    VERTEX_FIELD_NUMBER: _ClassVar[int]
    POINT_FIELD_NUMBER: _ClassVar[int]
    NORMAL_FIELD_NUMBER: _ClassVar[int]
    PROBE_START_FIELD_NUMBER: _ClassVar[int]
    PROBE_END_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    TERMS_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    STD_M_FIELD_NUMBER: _ClassVar[int]
    MEAN_GEODESIC_M_FIELD_NUMBER: _ClassVar[int]
    FAILURE_RISK_FIELD_NUMBER: _ClassVar[int]
    SENSOR_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_POSE_FIELD_NUMBER: _ClassVar[int]
    RELAXED_FIELD_NUMBER: _ClassVar[int]
    WHY_FIELD_NUMBER: _ClassVar[int]
    LEASE_EXPIRE_TIME_FIELD_NUMBER: _ClassVar[int]
    candidate_id: str
    vertex: int
    point: _geometry_pb2.Vector3
    normal: _geometry_pb2.Vector3
    probe_start: _geometry_pb2.Vector3
    probe_end: _geometry_pb2.Vector3
    score: float
    terms: _containers.RepeatedCompositeFieldContainer[ScoreTerm]
    uncertainty: float
    std_m: float
    mean_geodesic_m: float
    failure_risk: float
    sensor_id: str
    tool_pose: _geometry_pb2.Pose
    relaxed: bool
    why: str
    lease_expire_time: _timestamp_pb2.Timestamp
    def __init__(self, candidate_id: _Optional[str] = ..., vertex: _Optional[int] = ..., point: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., normal: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., probe_start: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., probe_end: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., score: _Optional[float] = ..., terms: _Optional[_Iterable[_Union[ScoreTerm, _Mapping]]] = ..., uncertainty: _Optional[float] = ..., std_m: _Optional[float] = ..., mean_geodesic_m: _Optional[float] = ..., failure_risk: _Optional[float] = ..., sensor_id: _Optional[str] = ..., tool_pose: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., relaxed: bool = ..., why: _Optional[str] = ..., lease_expire_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...

class ShadowChoice(_message.Message):
    __slots__ = ("strategy", "candidate", "hindsight")
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    CANDIDATE_FIELD_NUMBER: _ClassVar[int]
    HINDSIGHT_FIELD_NUMBER: _ClassVar[int]
    strategy: _strategy_pb2.Strategy
    candidate: Candidate
    hindsight: Hindsight
    def __init__(self, strategy: _Optional[_Union[_strategy_pb2.Strategy, str]] = ..., candidate: _Optional[_Union[Candidate, _Mapping]] = ..., hindsight: _Optional[_Union[Hindsight, str]] = ...) -> None: ...

class ScoreTerm(_message.Message):
    __slots__ = ("term", "weight", "value")
    TERM_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    term: str
    weight: float
    value: float
    def __init__(self, term: _Optional[str] = ..., weight: _Optional[float] = ..., value: _Optional[float] = ...) -> None: ...

class Excluded(_message.Message):
    __slots__ = ("already_certain", "no_confident_neighbour", "keep_out", "leased", "recently_failed", "unreachable")
    ALREADY_CERTAIN_FIELD_NUMBER: _ClassVar[int]
    NO_CONFIDENT_NEIGHBOUR_FIELD_NUMBER: _ClassVar[int]
    KEEP_OUT_FIELD_NUMBER: _ClassVar[int]
    LEASED_FIELD_NUMBER: _ClassVar[int]
    RECENTLY_FAILED_FIELD_NUMBER: _ClassVar[int]
    UNREACHABLE_FIELD_NUMBER: _ClassVar[int]
    already_certain: int
    no_confident_neighbour: int
    keep_out: int
    leased: int
    recently_failed: int
    unreachable: int
    def __init__(self, already_certain: _Optional[int] = ..., no_confident_neighbour: _Optional[int] = ..., keep_out: _Optional[int] = ..., leased: _Optional[int] = ..., recently_failed: _Optional[int] = ..., unreachable: _Optional[int] = ...) -> None: ...

class ExplainedVertex(_message.Message):
    __slots__ = ("vertex", "score", "terms", "uncertainty", "std_m", "mean_geodesic_m", "failure_risk", "excluded")
    VERTEX_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    TERMS_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    STD_M_FIELD_NUMBER: _ClassVar[int]
    MEAN_GEODESIC_M_FIELD_NUMBER: _ClassVar[int]
    FAILURE_RISK_FIELD_NUMBER: _ClassVar[int]
    EXCLUDED_FIELD_NUMBER: _ClassVar[int]
    vertex: int
    score: float
    terms: _containers.RepeatedCompositeFieldContainer[ScoreTerm]
    uncertainty: float
    std_m: float
    mean_geodesic_m: float
    failure_risk: float
    excluded: Exclusion
    def __init__(self, vertex: _Optional[int] = ..., score: _Optional[float] = ..., terms: _Optional[_Iterable[_Union[ScoreTerm, _Mapping]]] = ..., uncertainty: _Optional[float] = ..., std_m: _Optional[float] = ..., mean_geodesic_m: _Optional[float] = ..., failure_risk: _Optional[float] = ..., excluded: _Optional[_Union[Exclusion, str]] = ...) -> None: ...

class RobotContext(_message.Message):
    __slots__ = ("robot_id", "tool_pose", "keep_out")
    ROBOT_ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_POSE_FIELD_NUMBER: _ClassVar[int]
    KEEP_OUT_FIELD_NUMBER: _ClassVar[int]
    robot_id: str
    tool_pose: _geometry_pb2.Pose
    keep_out: _containers.RepeatedCompositeFieldContainer[KeepOut]
    def __init__(self, robot_id: _Optional[str] = ..., tool_pose: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., keep_out: _Optional[_Iterable[_Union[KeepOut, _Mapping]]] = ...) -> None: ...

class KeepOut(_message.Message):
    __slots__ = ("half_space", "ball")
    HALF_SPACE_FIELD_NUMBER: _ClassVar[int]
    BALL_FIELD_NUMBER: _ClassVar[int]
    half_space: HalfSpace
    ball: Ball
    def __init__(self, half_space: _Optional[_Union[HalfSpace, _Mapping]] = ..., ball: _Optional[_Union[Ball, _Mapping]] = ...) -> None: ...

class HalfSpace(_message.Message):
    __slots__ = ("normal", "offset_m")
    NORMAL_FIELD_NUMBER: _ClassVar[int]
    OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    normal: _geometry_pb2.Vector3
    offset_m: float
    def __init__(self, normal: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., offset_m: _Optional[float] = ...) -> None: ...

class Ball(_message.Message):
    __slots__ = ("center", "radius_m")
    CENTER_FIELD_NUMBER: _ClassVar[int]
    RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    center: _geometry_pb2.Vector3
    radius_m: float
    def __init__(self, center: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., radius_m: _Optional[float] = ...) -> None: ...
