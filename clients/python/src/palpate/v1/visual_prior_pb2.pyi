from google.protobuf import timestamp_pb2 as _timestamp_pb2
from palpate.v1 import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class PointEncoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    POINT_ENCODING_UNSPECIFIED: _ClassVar[PointEncoding]
    POINT_ENCODING_XYZ_F32_LE: _ClassVar[PointEncoding]
    POINT_ENCODING_PLY: _ClassVar[PointEncoding]
    POINT_ENCODING_DEPTH_U16: _ClassVar[PointEncoding]
    POINT_ENCODING_PCD: _ClassVar[PointEncoding]
    POINT_ENCODING_PACKED: _ClassVar[PointEncoding]
    POINT_ENCODING_DEPTH_PNG: _ClassVar[PointEncoding]
POINT_ENCODING_UNSPECIFIED: PointEncoding
POINT_ENCODING_XYZ_F32_LE: PointEncoding
POINT_ENCODING_PLY: PointEncoding
POINT_ENCODING_DEPTH_U16: PointEncoding
POINT_ENCODING_PCD: PointEncoding
POINT_ENCODING_PACKED: PointEncoding
POINT_ENCODING_DEPTH_PNG: PointEncoding

class VisualPrior(_message.Message):
    __slots__ = ("encoding", "points", "uncertainty", "viewpoint", "voxel_m", "capture_time", "depth", "packed", "keep_clutter")
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_FIELD_NUMBER: _ClassVar[int]
    VIEWPOINT_FIELD_NUMBER: _ClassVar[int]
    VOXEL_M_FIELD_NUMBER: _ClassVar[int]
    CAPTURE_TIME_FIELD_NUMBER: _ClassVar[int]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    PACKED_FIELD_NUMBER: _ClassVar[int]
    KEEP_CLUTTER_FIELD_NUMBER: _ClassVar[int]
    encoding: PointEncoding
    points: bytes
    uncertainty: float
    viewpoint: _geometry_pb2.Vector3
    voxel_m: float
    capture_time: _timestamp_pb2.Timestamp
    depth: DepthImage
    packed: PackedPoints
    keep_clutter: bool
    def __init__(self, encoding: _Optional[_Union[PointEncoding, str]] = ..., points: _Optional[bytes] = ..., uncertainty: _Optional[float] = ..., viewpoint: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., voxel_m: _Optional[float] = ..., capture_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., depth: _Optional[_Union[DepthImage, _Mapping]] = ..., packed: _Optional[_Union[PackedPoints, _Mapping]] = ..., keep_clutter: bool = ...) -> None: ...

class PackedPoints(_message.Message):
    __slots__ = ("point_step", "x_offset", "y_offset", "z_offset", "is_double", "is_bigendian", "width", "row_step")
    POINT_STEP_FIELD_NUMBER: _ClassVar[int]
    X_OFFSET_FIELD_NUMBER: _ClassVar[int]
    Y_OFFSET_FIELD_NUMBER: _ClassVar[int]
    Z_OFFSET_FIELD_NUMBER: _ClassVar[int]
    IS_DOUBLE_FIELD_NUMBER: _ClassVar[int]
    IS_BIGENDIAN_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    ROW_STEP_FIELD_NUMBER: _ClassVar[int]
    point_step: int
    x_offset: int
    y_offset: int
    z_offset: int
    is_double: bool
    is_bigendian: bool
    width: int
    row_step: int
    def __init__(self, point_step: _Optional[int] = ..., x_offset: _Optional[int] = ..., y_offset: _Optional[int] = ..., z_offset: _Optional[int] = ..., is_double: bool = ..., is_bigendian: bool = ..., width: _Optional[int] = ..., row_step: _Optional[int] = ...) -> None: ...

class DepthImage(_message.Message):
    __slots__ = ("width", "height", "fx", "fy", "cx", "cy", "depth_scale_m", "base_from_camera", "mask_u8", "min_depth_m", "max_depth_m")
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FX_FIELD_NUMBER: _ClassVar[int]
    FY_FIELD_NUMBER: _ClassVar[int]
    CX_FIELD_NUMBER: _ClassVar[int]
    CY_FIELD_NUMBER: _ClassVar[int]
    DEPTH_SCALE_M_FIELD_NUMBER: _ClassVar[int]
    BASE_FROM_CAMERA_FIELD_NUMBER: _ClassVar[int]
    MASK_U8_FIELD_NUMBER: _ClassVar[int]
    MIN_DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    MAX_DEPTH_M_FIELD_NUMBER: _ClassVar[int]
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    depth_scale_m: float
    base_from_camera: _geometry_pb2.Pose
    mask_u8: bytes
    min_depth_m: float
    max_depth_m: float
    def __init__(self, width: _Optional[int] = ..., height: _Optional[int] = ..., fx: _Optional[float] = ..., fy: _Optional[float] = ..., cx: _Optional[float] = ..., cy: _Optional[float] = ..., depth_scale_m: _Optional[float] = ..., base_from_camera: _Optional[_Union[_geometry_pb2.Pose, _Mapping]] = ..., mask_u8: _Optional[bytes] = ..., min_depth_m: _Optional[float] = ..., max_depth_m: _Optional[float] = ...) -> None: ...
