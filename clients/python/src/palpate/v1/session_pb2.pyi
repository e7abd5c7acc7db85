from google.protobuf import duration_pb2 as _duration_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from palpate.v1 import session_config_pb2 as _session_config_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SessionState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SESSION_STATE_UNSPECIFIED: _ClassVar[SessionState]
    SESSION_STATE_AWAITING_PRIOR: _ClassVar[SessionState]
    SESSION_STATE_ACTIVE: _ClassVar[SessionState]
    SESSION_STATE_FINISHED: _ClassVar[SessionState]
    SESSION_STATE_QUARANTINED: _ClassVar[SessionState]

class StopReason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    STOP_REASON_UNSPECIFIED: _ClassVar[StopReason]
    STOP_REASON_COVERAGE: _ClassVar[StopReason]
    STOP_REASON_GAIN_BELOW: _ClassVar[StopReason]
    STOP_REASON_BUDGET: _ClassVar[StopReason]
    STOP_REASON_NO_ADMISSIBLE_CANDIDATE: _ClassVar[StopReason]
    STOP_REASON_STALLED: _ClassVar[StopReason]
    STOP_REASON_DIVERGED: _ClassVar[StopReason]
    STOP_REASON_MOVED: _ClassVar[StopReason]
SESSION_STATE_UNSPECIFIED: SessionState
SESSION_STATE_AWAITING_PRIOR: SessionState
SESSION_STATE_ACTIVE: SessionState
SESSION_STATE_FINISHED: SessionState
SESSION_STATE_QUARANTINED: SessionState
STOP_REASON_UNSPECIFIED: StopReason
STOP_REASON_COVERAGE: StopReason
STOP_REASON_GAIN_BELOW: StopReason
STOP_REASON_BUDGET: StopReason
STOP_REASON_NO_ADMISSIBLE_CANDIDATE: StopReason
STOP_REASON_STALLED: StopReason
STOP_REASON_DIVERGED: StopReason
STOP_REASON_MOVED: StopReason

class Session(_message.Message):
    __slots__ = ("session_id", "display_name", "experiment", "frame_id", "labels", "config", "state", "revision", "etag", "stats", "create_time", "update_time", "forked_from", "forked_at_revision", "algorithm_version", "should_stop", "quarantine", "finish_note", "retracted_seqs")
    class LabelsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    EXPERIMENT_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    CONFIG_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ETAG_FIELD_NUMBER: _ClassVar[int]
    STATS_FIELD_NUMBER: _ClassVar[int]
    CREATE_TIME_FIELD_NUMBER: _ClassVar[int]
    UPDATE_TIME_FIELD_NUMBER: _ClassVar[int]
    FORKED_FROM_FIELD_NUMBER: _ClassVar[int]
    FORKED_AT_REVISION_FIELD_NUMBER: _ClassVar[int]
    ALGORITHM_VERSION_FIELD_NUMBER: _ClassVar[int]
    SHOULD_STOP_FIELD_NUMBER: _ClassVar[int]
    QUARANTINE_FIELD_NUMBER: _ClassVar[int]
    FINISH_NOTE_FIELD_NUMBER: _ClassVar[int]
    RETRACTED_SEQS_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    display_name: str
    experiment: str
    frame_id: str
    labels: _containers.ScalarMap[str, str]
    config: _session_config_pb2.SessionConfig
    state: SessionState
    revision: int
    etag: str
    stats: SessionStats
    create_time: _timestamp_pb2.Timestamp
    update_time: _timestamp_pb2.Timestamp
    forked_from: str
    forked_at_revision: int
    algorithm_version: str
    should_stop: StopReason
    quarantine: Quarantine
    finish_note: str
    retracted_seqs: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, session_id: _Optional[str] = ..., display_name: _Optional[str] = ..., experiment: _Optional[str] = ..., frame_id: _Optional[str] = ..., labels: _Optional[_Mapping[str, str]] = ..., config: _Optional[_Union[_session_config_pb2.SessionConfig, _Mapping]] = ..., state: _Optional[_Union[SessionState, str]] = ..., revision: _Optional[int] = ..., etag: _Optional[str] = ..., stats: _Optional[_Union[SessionStats, _Mapping]] = ..., create_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., update_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., forked_from: _Optional[str] = ..., forked_at_revision: _Optional[int] = ..., algorithm_version: _Optional[str] = ..., should_stop: _Optional[_Union[StopReason, str]] = ..., quarantine: _Optional[_Union[Quarantine, _Mapping]] = ..., finish_note: _Optional[str] = ..., retracted_seqs: _Optional[_Iterable[int]] = ...) -> None: ...

class Quarantine(_message.Message):
    __slots__ = ("reason", "sound_revision", "head")
    REASON_FIELD_NUMBER: _ClassVar[int]
    SOUND_REVISION_FIELD_NUMBER: _ClassVar[int]
    HEAD_FIELD_NUMBER: _ClassVar[int]
    reason: str
    sound_revision: int
    head: int
    def __init__(self, reason: _Optional[str] = ..., sound_revision: _Optional[int] = ..., head: _Optional[int] = ...) -> None: ...

class SessionStats(_message.Message):
    __slots__ = ("visual_points", "contacts", "no_contacts", "rejected", "mean_uncertainty", "max_uncertainty", "fit_rms_m", "template", "last_update", "early_contacts", "invalid_contacts", "failures", "attempts", "consecutive_failures", "doubted_seqs", "camera_offsets", "motion", "doubted_points", "mean_std_m", "max_std_m")
    VISUAL_POINTS_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    NO_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    REJECTED_FIELD_NUMBER: _ClassVar[int]
    MEAN_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    MAX_UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    FIT_RMS_M_FIELD_NUMBER: _ClassVar[int]
    TEMPLATE_FIELD_NUMBER: _ClassVar[int]
    LAST_UPDATE_FIELD_NUMBER: _ClassVar[int]
    EARLY_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    INVALID_CONTACTS_FIELD_NUMBER: _ClassVar[int]
    FAILURES_FIELD_NUMBER: _ClassVar[int]
    ATTEMPTS_FIELD_NUMBER: _ClassVar[int]
    CONSECUTIVE_FAILURES_FIELD_NUMBER: _ClassVar[int]
    DOUBTED_SEQS_FIELD_NUMBER: _ClassVar[int]
    CAMERA_OFFSETS_FIELD_NUMBER: _ClassVar[int]
    MOTION_FIELD_NUMBER: _ClassVar[int]
    DOUBTED_POINTS_FIELD_NUMBER: _ClassVar[int]
    MEAN_STD_M_FIELD_NUMBER: _ClassVar[int]
    MAX_STD_M_FIELD_NUMBER: _ClassVar[int]
    visual_points: int
    contacts: int
    no_contacts: int
    rejected: int
    mean_uncertainty: float
    max_uncertainty: float
    fit_rms_m: float
    template: str
    last_update: _duration_pb2.Duration
    early_contacts: int
    invalid_contacts: int
    failures: int
    attempts: int
    consecutive_failures: int
    doubted_seqs: _containers.RepeatedScalarFieldContainer[int]
    camera_offsets: _containers.RepeatedCompositeFieldContainer[CameraOffset]
    motion: ObjectMotion
    doubted_points: int
    mean_std_m: float
    max_std_m: float
    def __init__(self, visual_points: _Optional[int] = ..., contacts: _Optional[int] = ..., no_contacts: _Optional[int] = ..., rejected: _Optional[int] = ..., mean_uncertainty: _Optional[float] = ..., max_uncertainty: _Optional[float] = ..., fit_rms_m: _Optional[float] = ..., template: _Optional[str] = ..., last_update: _Optional[_Union[_duration_pb2.Duration, _Mapping]] = ..., early_contacts: _Optional[int] = ..., invalid_contacts: _Optional[int] = ..., failures: _Optional[int] = ..., attempts: _Optional[int] = ..., consecutive_failures: _Optional[int] = ..., doubted_seqs: _Optional[_Iterable[int]] = ..., camera_offsets: _Optional[_Iterable[_Union[CameraOffset, _Mapping]]] = ..., motion: _Optional[_Union[ObjectMotion, _Mapping]] = ..., doubted_points: _Optional[int] = ..., mean_std_m: _Optional[float] = ..., max_std_m: _Optional[float] = ...) -> None: ...

class CameraOffset(_message.Message):
    __slots__ = ("seq", "translation_m", "std_m", "rotation_rad", "rotation_std_rad")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    TRANSLATION_M_FIELD_NUMBER: _ClassVar[int]
    STD_M_FIELD_NUMBER: _ClassVar[int]
    ROTATION_RAD_FIELD_NUMBER: _ClassVar[int]
    ROTATION_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    seq: int
    translation_m: _geometry_pb2.Vector3
    std_m: float
    rotation_rad: _geometry_pb2.Vector3
    rotation_std_rad: float
    def __init__(self, seq: _Optional[int] = ..., translation_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., std_m: _Optional[float] = ..., rotation_rad: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., rotation_std_rad: _Optional[float] = ...) -> None: ...

class ObjectMotion(_message.Message):
    __slots__ = ("since_seq", "translation_m", "std_m", "followed")
    SINCE_SEQ_FIELD_NUMBER: _ClassVar[int]
    TRANSLATION_M_FIELD_NUMBER: _ClassVar[int]
    STD_M_FIELD_NUMBER: _ClassVar[int]
    FOLLOWED_FIELD_NUMBER: _ClassVar[int]
    since_seq: int
    translation_m: _geometry_pb2.Vector3
    std_m: float
    followed: bool
    def __init__(self, since_seq: _Optional[int] = ..., translation_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., std_m: _Optional[float] = ..., followed: bool = ...) -> None: ...
