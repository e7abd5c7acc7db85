from google.protobuf import field_mask_pb2 as _field_mask_pb2
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import candidate_pb2 as _candidate_pb2
from palpate.v1 import contact_pb2 as _contact_pb2
from palpate.v1 import session_pb2 as _session_pb2
from palpate.v1 import session_service_pb2 as _session_service_pb2
from palpate.v1 import visual_prior_pb2 as _visual_prior_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Event(_message.Message):
    __slots__ = ("seq", "append_time", "actor", "request_id", "created", "visual_prior", "contact_result", "retracted_seq", "finished", "lease", "forked", "updated", "stats_after", "state_hash", "retraction_reason", "retracted_by_seq", "shadow_choices")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    APPEND_TIME_FIELD_NUMBER: _ClassVar[int]
    ACTOR_FIELD_NUMBER: _ClassVar[int]
    REQUEST_ID_FIELD_NUMBER: _ClassVar[int]
    CREATED_FIELD_NUMBER: _ClassVar[int]
    VISUAL_PRIOR_FIELD_NUMBER: _ClassVar[int]
    CONTACT_RESULT_FIELD_NUMBER: _ClassVar[int]
    RETRACTED_SEQ_FIELD_NUMBER: _ClassVar[int]
    FINISHED_FIELD_NUMBER: _ClassVar[int]
    LEASE_FIELD_NUMBER: _ClassVar[int]
    FORKED_FIELD_NUMBER: _ClassVar[int]
    UPDATED_FIELD_NUMBER: _ClassVar[int]
    STATS_AFTER_FIELD_NUMBER: _ClassVar[int]
    STATE_HASH_FIELD_NUMBER: _ClassVar[int]
    RETRACTION_REASON_FIELD_NUMBER: _ClassVar[int]
    RETRACTED_BY_SEQ_FIELD_NUMBER: _ClassVar[int]
    SHADOW_CHOICES_FIELD_NUMBER: _ClassVar[int]
    seq: int
    append_time: _timestamp_pb2.Timestamp
    actor: str
    request_id: str
    created: _session_service_pb2.CreateSessionRequest
    visual_prior: _visual_prior_pb2.VisualPrior
    contact_result: _contact_pb2.ContactResult
    retracted_seq: int
    finished: str
    lease: Lease
    forked: Forked
    updated: Updated
    stats_after: _session_pb2.SessionStats
    state_hash: str
    retraction_reason: str
    retracted_by_seq: int
    shadow_choices: _containers.RepeatedCompositeFieldContainer[_candidate_pb2.ShadowChoice]
    def __init__(self, seq: _Optional[int] = ..., append_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., actor: _Optional[str] = ..., request_id: _Optional[str] = ..., created: _Optional[_Union[_session_service_pb2.CreateSessionRequest, _Mapping]] = ..., visual_prior: _Optional[_Union[_visual_prior_pb2.VisualPrior, _Mapping]] = ..., contact_result: _Optional[_Union[_contact_pb2.ContactResult, _Mapping]] = ..., retracted_seq: _Optional[int] = ..., finished: _Optional[str] = ..., lease: _Optional[_Union[Lease, _Mapping]] = ..., forked: _Optional[_Union[Forked, _Mapping]] = ..., updated: _Optional[_Union[Updated, _Mapping]] = ..., stats_after: _Optional[_Union[_session_pb2.SessionStats, _Mapping]] = ..., state_hash: _Optional[str] = ..., retraction_reason: _Optional[str] = ..., retracted_by_seq: _Optional[int] = ..., shadow_choices: _Optional[_Iterable[_Union[_candidate_pb2.ShadowChoice, _Mapping]]] = ...) -> None: ...

class Forked(_message.Message):
    __slots__ = ("definition", "ancestors")
    DEFINITION_FIELD_NUMBER: _ClassVar[int]
    ANCESTORS_FIELD_NUMBER: _ClassVar[int]
    definition: _session_service_pb2.CreateSessionRequest
    ancestors: _containers.RepeatedCompositeFieldContainer[Ancestor]
    def __init__(self, definition: _Optional[_Union[_session_service_pb2.CreateSessionRequest, _Mapping]] = ..., ancestors: _Optional[_Iterable[_Union[Ancestor, _Mapping]]] = ...) -> None: ...

class Ancestor(_message.Message):
    __slots__ = ("session_id", "revision")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    revision: int
    def __init__(self, session_id: _Optional[str] = ..., revision: _Optional[int] = ...) -> None: ...

class Updated(_message.Message):
    __slots__ = ("update_mask", "display_name", "labels")
    class LabelsEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: str
        def __init__(self, key: _Optional[str] = ..., value: _Optional[str] = ...) -> None: ...
    UPDATE_MASK_FIELD_NUMBER: _ClassVar[int]
    DISPLAY_NAME_FIELD_NUMBER: _ClassVar[int]
    LABELS_FIELD_NUMBER: _ClassVar[int]
    update_mask: _field_mask_pb2.FieldMask
    display_name: str
    labels: _containers.ScalarMap[str, str]
    def __init__(self, update_mask: _Optional[_Union[_field_mask_pb2.FieldMask, _Mapping]] = ..., display_name: _Optional[str] = ..., labels: _Optional[_Mapping[str, str]] = ...) -> None: ...

class Lease(_message.Message):
    __slots__ = ("robot_id", "candidate_ids", "expire_time")
    ROBOT_ID_FIELD_NUMBER: _ClassVar[int]
    CANDIDATE_IDS_FIELD_NUMBER: _ClassVar[int]
    EXPIRE_TIME_FIELD_NUMBER: _ClassVar[int]
    robot_id: str
    candidate_ids: _containers.RepeatedScalarFieldContainer[str]
    expire_time: _timestamp_pb2.Timestamp
    def __init__(self, robot_id: _Optional[str] = ..., candidate_ids: _Optional[_Iterable[str]] = ..., expire_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ...) -> None: ...
