from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RejectReason(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    REJECT_REASON_UNSPECIFIED: _ClassVar[RejectReason]
    REJECT_REASON_NO_IK: _ClassVar[RejectReason]
    REJECT_REASON_COLLISION: _ClassVar[RejectReason]
    REJECT_REASON_SAFETY_STOP: _ClassVar[RejectReason]
    REJECT_REASON_TIMEOUT: _ClassVar[RejectReason]
    REJECT_REASON_OPERATOR: _ClassVar[RejectReason]
REJECT_REASON_UNSPECIFIED: RejectReason
REJECT_REASON_NO_IK: RejectReason
REJECT_REASON_COLLISION: RejectReason
REJECT_REASON_SAFETY_STOP: RejectReason
REJECT_REASON_TIMEOUT: RejectReason
REJECT_REASON_OPERATOR: RejectReason

class ContactResult(_message.Message):
    __slots__ = ("candidate_id", "robot_id", "observe_time", "contact", "no_contact", "rejected", "invalid_contact", "contacts", "object_moved")
    CANDIDATE_ID_FIELD_NUMBER: _ClassVar[int]
    ROBOT_ID_FIELD_NUMBER: _ClassVar[int]
    OBSERVE_TIME_FIELD_NUMBER: _ClassVar[int]
    CONTACT_FIELD_NUMBER: _ClassVar[int]
    NO_CONTACT_FIELD_NUMBER: _ClassVar[int]
    REJECTED_FIELD_NUMBER: _ClassVar[int]
    INVALID_CONTACT_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    OBJECT_MOVED_FIELD_NUMBER: _ClassVar[int]
    candidate_id: str
    robot_id: str
    observe_time: _timestamp_pb2.Timestamp
    contact: Contact
    no_contact: NoContact
    rejected: Rejected
    invalid_contact: InvalidContact
    contacts: Contacts
    object_moved: ObjectMoved
    def __init__(self, candidate_id: _Optional[str] = ..., robot_id: _Optional[str] = ..., observe_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., contact: _Optional[_Union[Contact, _Mapping]] = ..., no_contact: _Optional[_Union[NoContact, _Mapping]] = ..., rejected: _Optional[_Union[Rejected, _Mapping]] = ..., invalid_contact: _Optional[_Union[InvalidContact, _Mapping]] = ..., contacts: _Optional[_Union[Contacts, _Mapping]] = ..., object_moved: _Optional[_Union[ObjectMoved, _Mapping]] = ...) -> None: ...

class Contacts(_message.Message):
    __slots__ = ("contacts",)
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    contacts: _containers.RepeatedCompositeFieldContainer[Contact]
    def __init__(self, contacts: _Optional[_Iterable[_Union[Contact, _Mapping]]] = ...) -> None: ...

class ObjectMoved(_message.Message):
    __slots__ = ("new_from_old", "std_m", "detail")
    NEW_FROM_OLD_FIELD_NUMBER: _ClassVar[int]
    STD_M_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    new_from_old: _geometry_pb2.Pose
    std_m: float
    detail: str
    def __init__(self, new_from_old: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., std_m: _Optional[float] = ..., detail: _Optional[str] = ...) -> None: ...

class Contact(_message.Message):
    __slots__ = ("sensor_pose", "wrench", "sensor_id", "uncertainty", "swept_from", "normal", "rest_wrench")
    SENSOR_POSE_FIELD_NUMBER: _ClassVar[int]
    WRENCH_FIELD_NUMBER: _ClassVar[int]
    SENSOR_ID_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    SWEPT_FROM_FIELD_NUMBER: _ClassVar[int]
    NORMAL_FIELD_NUMBER: _ClassVar[int]
    REST_WRENCH_FIELD_NUMBER: _ClassVar[int]
    sensor_pose: _geometry_pb2.Pose
    wrench: _geometry_pb2.Wrench
    sensor_id: str
    uncertainty: float
    swept_from: _geometry_pb2.Vector3
    normal: _geometry_pb2.Vector3
    rest_wrench: _geometry_pb2.Wrench
    def __init__(self, sensor_pose: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., wrench: _Optional[_Union[_geometry_pb2.Wrench, _Mapping]] = ..., sensor_id: _Optional[str] = ..., uncertainty: _Optional[float] = ..., swept_from: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., normal: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., rest_wrench: _Optional[_Union[_geometry_pb2.Wrench, _Mapping]] = ...) -> None: ...

class NoContact(_message.Message):
    __slots__ = ("swept_from", "swept_to", "sweep_radius_m")
    SWEPT_FROM_FIELD_NUMBER: _ClassVar[int]
    SWEPT_TO_FIELD_NUMBER: _ClassVar[int]
    SWEEP_RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    swept_from: _geometry_pb2.Vector3
    swept_to: _geometry_pb2.Vector3
    sweep_radius_m: float
    def __init__(self, swept_from: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., swept_to: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., sweep_radius_m: _Optional[float] = ...) -> None: ...

class InvalidContact(_message.Message):
    __slots__ = ("sensor_pose", "detail")
    SENSOR_POSE_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    sensor_pose: _geometry_pb2.Pose
    detail: str
    def __init__(self, sensor_pose: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., detail: _Optional[str] = ...) -> None: ...

class Rejected(_message.Message):
    __slots__ = ("reason", "detail")
    REASON_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    reason: RejectReason
    detail: str
    def __init__(self, reason: _Optional[_Union[RejectReason, str]] = ..., detail: _Optional[str] = ...) -> None: ...
