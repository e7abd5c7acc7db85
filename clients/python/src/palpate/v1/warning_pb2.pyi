from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class WarningCode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    WARNING_CODE_UNSPECIFIED: _ClassVar[WarningCode]
    WARNING_CODE_NO_VIEWPOINT: _ClassVar[WarningCode]
    WARNING_CODE_EARLY_CONTACT: _ClassVar[WarningCode]
    WARNING_CODE_NORMAL_IGNORED: _ClassVar[WarningCode]
    WARNING_CODE_ZERO_WRENCH: _ClassVar[WarningCode]
    WARNING_CODE_PULLING_FORCE: _ClassVar[WarningCode]
    WARNING_CODE_WRENCH_FRAME: _ClassVar[WarningCode]
    WARNING_CODE_TORQUE_TOO_LARGE: _ClassVar[WarningCode]
    WARNING_CODE_TOUCHED_BY_HOUSING: _ClassVar[WarningCode]
    WARNING_CODE_TARE_DRIFT: _ClassVar[WarningCode]
    WARNING_CODE_QUATERNION_ORDER: _ClassVar[WarningCode]
    WARNING_CODE_CANDIDATE_OF_ANOTHER_SESSION: _ClassVar[WarningCode]
    WARNING_CODE_DOUBTED_CONTACT: _ClassVar[WarningCode]
    WARNING_CODE_OBJECT_MOVED: _ClassVar[WarningCode]
    WARNING_CODE_CAMERA_OFFSET: _ClassVar[WarningCode]
    WARNING_CODE_NON_FINITE_POINTS: _ClassVar[WarningCode]
    WARNING_CODE_SUPPORT_POINTS: _ClassVar[WarningCode]
    WARNING_CODE_ISOLATED_POINTS: _ClassVar[WarningCode]
    WARNING_CODE_REPEATED_POINTS: _ClassVar[WarningCode]
    WARNING_CODE_IMPLAUSIBLE_SIZE: _ClassVar[WarningCode]
    WARNING_CODE_NOTHING_NEW: _ClassVar[WarningCode]
    WARNING_CODE_NO_TABLE: _ClassVar[WarningCode]
    WARNING_CODE_FAR_CONTACT: _ClassVar[WarningCode]
    WARNING_CODE_WEAK_CONTACT: _ClassVar[WarningCode]
    WARNING_CODE_LONG_SWEEP: _ClassVar[WarningCode]
WARNING_CODE_UNSPECIFIED: WarningCode
WARNING_CODE_NO_VIEWPOINT: WarningCode
WARNING_CODE_EARLY_CONTACT: WarningCode
WARNING_CODE_NORMAL_IGNORED: WarningCode
WARNING_CODE_ZERO_WRENCH: WarningCode
WARNING_CODE_PULLING_FORCE: WarningCode
WARNING_CODE_WRENCH_FRAME: WarningCode
WARNING_CODE_TORQUE_TOO_LARGE: WarningCode
WARNING_CODE_TOUCHED_BY_HOUSING: WarningCode
WARNING_CODE_TARE_DRIFT: WarningCode
WARNING_CODE_QUATERNION_ORDER: WarningCode
WARNING_CODE_CANDIDATE_OF_ANOTHER_SESSION: WarningCode
WARNING_CODE_DOUBTED_CONTACT: WarningCode
WARNING_CODE_OBJECT_MOVED: WarningCode
WARNING_CODE_CAMERA_OFFSET: WarningCode
WARNING_CODE_NON_FINITE_POINTS: WarningCode
WARNING_CODE_SUPPORT_POINTS: WarningCode
WARNING_CODE_ISOLATED_POINTS: WarningCode
WARNING_CODE_REPEATED_POINTS: WarningCode
WARNING_CODE_IMPLAUSIBLE_SIZE: WarningCode
WARNING_CODE_NOTHING_NEW: WarningCode
WARNING_CODE_NO_TABLE: WarningCode
WARNING_CODE_FAR_CONTACT: WarningCode
WARNING_CODE_WEAK_CONTACT: WarningCode
WARNING_CODE_LONG_SWEEP: WarningCode

class Warning(_message.Message):
    __slots__ = ("code", "message", "parameters")
    class ParametersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: float
        def __init__(self, key: _Optional[str] = ..., value: _Optional[float] = ...) -> None: ...
    CODE_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    code: WarningCode
    message: str
    parameters: _containers.ScalarMap[str, float]
    def __init__(self, code: _Optional[_Union[WarningCode, str]] = ..., message: _Optional[str] = ..., parameters: _Optional[_Mapping[str, float]] = ...) -> None: ...
