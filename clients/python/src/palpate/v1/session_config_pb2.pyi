from palpate.v1 import candidate_pb2 as _candidate_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from palpate.v1 import strategy_pb2 as _strategy_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class OnMotion(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ON_MOTION_UNSPECIFIED: _ClassVar[OnMotion]
    ON_MOTION_FOLLOW: _ClassVar[OnMotion]
    ON_MOTION_WARN: _ClassVar[OnMotion]

class Method(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    METHOD_UNSPECIFIED: _ClassVar[Method]
    METHOD_PAPER: _ClassVar[Method]
    METHOD_PALPATE: _ClassVar[Method]
    METHOD_GPIS: _ClassVar[Method]

class TemplateAxes(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    TEMPLATE_AXES_UNSPECIFIED: _ClassVar[TemplateAxes]
    TEMPLATE_AXES_FRAME: _ClassVar[TemplateAxes]
    TEMPLATE_AXES_FREE: _ClassVar[TemplateAxes]

class Symmetry(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SYMMETRY_UNSPECIFIED: _ClassVar[Symmetry]
    SYMMETRY_REVOLUTION: _ClassVar[Symmetry]
    SYMMETRY_MIRROR: _ClassVar[Symmetry]

class TouchedPoint(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    TOUCHED_POINT_UNSPECIFIED: _ClassVar[TouchedPoint]
    TOUCHED_POINT_PAD_CENTER: _ClassVar[TouchedPoint]
    TOUCHED_POINT_CENTER_OF_PRESSURE: _ClassVar[TouchedPoint]
ON_MOTION_UNSPECIFIED: OnMotion
ON_MOTION_FOLLOW: OnMotion
ON_MOTION_WARN: OnMotion
METHOD_UNSPECIFIED: Method
METHOD_PAPER: Method
METHOD_PALPATE: Method
METHOD_GPIS: Method
TEMPLATE_AXES_UNSPECIFIED: TemplateAxes
TEMPLATE_AXES_FRAME: TemplateAxes
TEMPLATE_AXES_FREE: TemplateAxes
SYMMETRY_UNSPECIFIED: Symmetry
SYMMETRY_REVOLUTION: Symmetry
SYMMETRY_MIRROR: Symmetry
TOUCHED_POINT_UNSPECIFIED: TouchedPoint
TOUCHED_POINT_PAD_CENTER: TouchedPoint
TOUCHED_POINT_CENTER_OF_PRESSURE: TouchedPoint

class SessionConfig(_message.Message):
    __slots__ = ("method", "strategy", "alpha_geodesic", "alpha_uncertainty", "alpha_travel", "confident_max", "candidate_min", "visual_uncertainty", "tactile_u_max", "propagation_hops", "propagation_length_m", "probe_half_travel_m", "failure_distance_m", "icosphere_subdivisions", "seed", "sensors", "stop", "symmetry", "keep_out", "template_axes", "support", "on_motion", "plausible_size", "shadow")
    METHOD_FIELD_NUMBER: _ClassVar[int]
    STRATEGY_FIELD_NUMBER: _ClassVar[int]
    ALPHA_GEODESIC_FIELD_NUMBER: _ClassVar[int]
    ALPHA_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    ALPHA_TRAVEL_FIELD_NUMBER: _ClassVar[int]
    CONFIDENT_MAX_FIELD_NUMBER: _ClassVar[int]
    CANDIDATE_MIN_FIELD_NUMBER: _ClassVar[int]
    VISUAL_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    TACTILE_U_MAX_FIELD_NUMBER: _ClassVar[int]
    PROPAGATION_HOPS_FIELD_NUMBER: _ClassVar[int]
    PROPAGATION_LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    PROBE_HALF_TRAVEL_M_FIELD_NUMBER: _ClassVar[int]
    FAILURE_DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    ICOSPHERE_SUBDIVISIONS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SENSORS_FIELD_NUMBER: _ClassVar[int]
    STOP_FIELD_NUMBER: _ClassVar[int]
    SYMMETRY_FIELD_NUMBER: _ClassVar[int]
    KEEP_OUT_FIELD_NUMBER: _ClassVar[int]
    TEMPLATE_AXES_FIELD_NUMBER: _ClassVar[int]
    SUPPORT_FIELD_NUMBER: _ClassVar[int]
    ON_MOTION_FIELD_NUMBER: _ClassVar[int]
    PLAUSIBLE_SIZE_FIELD_NUMBER: _ClassVar[int]
    SHADOW_FIELD_NUMBER: _ClassVar[int]
    method: Method
    strategy: _strategy_pb2.Strategy
    alpha_geodesic: float
    alpha_uncertainty: float
    alpha_travel: float
    confident_max: float
    candidate_min: float
    visual_uncertainty: float
    tactile_u_max: float
    propagation_hops: int
    propagation_length_m: float
    probe_half_travel_m: float
    failure_distance_m: float
    icosphere_subdivisions: int
    seed: int
    sensors: _containers.RepeatedCompositeFieldContainer[Sensor]
    stop: StopRule
    symmetry: Symmetry
    keep_out: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.KeepOut]
    template_axes: TemplateAxes
    support: _candidate_pb2.HalfSpace
    on_motion: OnMotion
    plausible_size: PlausibleSize
    shadow: _containers.RepeatedScalarFieldContainer[_strategy_pb2.Strategy]
    def __init__(self, method: _Optional[_Union[Method, str]] = ..., strategy: _Optional[_Union[_strategy_pb2.Strategy, str]] = ..., alpha_geodesic: _Optional[float] = ..., alpha_uncertainty: _Optional[float] = ..., alpha_travel: _Optional[float] = ..., confident_max: _Optional[float] = ..., candidate_min: _Optional[float] = ..., visual_uncertainty: _Optional[float] = ..., tactile_u_max: _Optional[float] = ..., propagation_hops: _Optional[int] = ..., propagation_length_m: _Optional[float] = ..., probe_half_travel_m: _Optional[float] = ..., failure_distance_m: _Optional[float] = ..., icosphere_subdivisions: _Optional[int] = ..., seed: _Optional[int] = ..., sensors: _Optional[_Iterable[_Union[Sensor, _Mapping]]] = ..., stop: _Optional[_Union[StopRule, _Mapping]] = ..., symmetry: _Optional[_Union[Symmetry, str]] = ..., keep_out: _Optional[_Iterable[_Union[_candidate_pb2.KeepOut, _Mapping]]] = ..., template_axes: _Optional[_Union[TemplateAxes, str]] = ..., support: _Optional[_Union[_candidate_pb2.HalfSpace, _Mapping]] = ..., on_motion: _Optional[_Union[OnMotion, str]] = ..., plausible_size: _Optional[_Union[PlausibleSize, _Mapping]] = ..., shadow: _Optional[_Iterable[_Union[_strategy_pb2.Strategy, str]]] = ...) -> None: ...

class PlausibleSize(_message.Message):
    __slots__ = ("min_m", "max_m", "refuse_above_m")
    MIN_M_FIELD_NUMBER: _ClassVar[int]
    MAX_M_FIELD_NUMBER: _ClassVar[int]
    REFUSE_ABOVE_M_FIELD_NUMBER: _ClassVar[int]
    min_m: float
    max_m: float
    refuse_above_m: float
    def __init__(self, min_m: _Optional[float] = ..., max_m: _Optional[float] = ..., refuse_above_m: _Optional[float] = ...) -> None: ...

class Sensor(_message.Message):
    __slots__ = ("id", "tool_from_sensor", "pad_half_side_m", "contact_force_n", "force_noise_n", "torque_noise_nm", "touched_point")
    ID_FIELD_NUMBER: _ClassVar[int]
    TOOL_FROM_SENSOR_FIELD_NUMBER: _ClassVar[int]
    PAD_HALF_SIDE_M_FIELD_NUMBER: _ClassVar[int]
    CONTACT_FORCE_N_FIELD_NUMBER: _ClassVar[int]
    FORCE_NOISE_N_FIELD_NUMBER: _ClassVar[int]
    TORQUE_NOISE_NM_FIELD_NUMBER: _ClassVar[int]
    TOUCHED_POINT_FIELD_NUMBER: _ClassVar[int]
    id: str
    tool_from_sensor: _geometry_pb2.Pose
    pad_half_side_m: float
    contact_force_n: float
    force_noise_n: float
    torque_noise_nm: float
    touched_point: TouchedPoint
    def __init__(self, id: _Optional[str] = ..., tool_from_sensor: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., pad_half_side_m: _Optional[float] = ..., contact_force_n: _Optional[float] = ..., force_noise_n: _Optional[float] = ..., torque_noise_nm: _Optional[float] = ..., touched_point: _Optional[_Union[TouchedPoint, str]] = ...) -> None: ...

class StopRule(_message.Message):
    __slots__ = ("max_attempts", "mean_uncertainty_below", "max_consecutive_failures")
    MAX_ATTEMPTS_FIELD_NUMBER: _ClassVar[int]
    MEAN_UNCERTAINTY_BELOW_FIELD_NUMBER: _ClassVar[int]
    MAX_CONSECUTIVE_FAILURES_FIELD_NUMBER: _ClassVar[int]
    max_attempts: int
    mean_uncertainty_below: float
    max_consecutive_failures: int
    def __init__(self, max_attempts: _Optional[int] = ..., mean_uncertainty_below: _Optional[float] = ..., max_consecutive_failures: _Optional[int] = ...) -> None: ...
