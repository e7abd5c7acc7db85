from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from typing import ClassVar as _ClassVar

DESCRIPTOR: _descriptor.FileDescriptor

class Strategy(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    STRATEGY_UNSPECIFIED: _ClassVar[Strategy]
    STRATEGY_PROACTIVE: _ClassVar[Strategy]
    STRATEGY_MIN_UNCERTAINTY: _ClassVar[Strategy]
    STRATEGY_UNIFORM: _ClassVar[Strategy]
    STRATEGY_RANDOM: _ClassVar[Strategy]
    STRATEGY_EXPECTED_GAIN: _ClassVar[Strategy]
STRATEGY_UNSPECIFIED: Strategy
STRATEGY_PROACTIVE: Strategy
STRATEGY_MIN_UNCERTAINTY: Strategy
STRATEGY_UNIFORM: Strategy
STRATEGY_RANDOM: Strategy
STRATEGY_EXPECTED_GAIN: Strategy
