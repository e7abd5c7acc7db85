from palpate.v1 import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class MeshFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MESH_FORMAT_UNSPECIFIED: _ClassVar[MeshFormat]
    MESH_FORMAT_RAW: _ClassVar[MeshFormat]
    MESH_FORMAT_PLY: _ClassVar[MeshFormat]
    MESH_FORMAT_OBJ: _ClassVar[MeshFormat]
    MESH_FORMAT_STL: _ClassVar[MeshFormat]
    MESH_FORMAT_GLB: _ClassVar[MeshFormat]

class Colormap(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    COLORMAP_UNSPECIFIED: _ClassVar[Colormap]
    COLORMAP_PAPER: _ClassVar[Colormap]
    COLORMAP_CIVIDIS: _ClassVar[Colormap]
MESH_FORMAT_UNSPECIFIED: MeshFormat
MESH_FORMAT_RAW: MeshFormat
MESH_FORMAT_PLY: MeshFormat
MESH_FORMAT_OBJ: MeshFormat
MESH_FORMAT_STL: MeshFormat
MESH_FORMAT_GLB: MeshFormat
COLORMAP_UNSPECIFIED: Colormap
COLORMAP_PAPER: Colormap
COLORMAP_CIVIDIS: Colormap

class Mesh(_message.Message):
    __slots__ = ("revision", "etag", "content_type", "not_modified", "file", "raw", "doubted")
    REVISION_FIELD_NUMBER: _ClassVar[int]
    ETAG_FIELD_NUMBER: _ClassVar[int]
    CONTENT_TYPE_FIELD_NUMBER: _ClassVar[int]
    NOT_MODIFIED_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    RAW_FIELD_NUMBER: _ClassVar[int]
    DOUBTED_FIELD_NUMBER: _ClassVar[int]
    revision: int
    etag: str
    content_type: str
    not_modified: bool
    file: bytes
    raw: RawMesh
    doubted: _containers.RepeatedCompositeFieldContainer[DoubtedContact]
    def __init__(self, revision: _Optional[int] = ..., etag: _Optional[str] = ..., content_type: _Optional[str] = ..., not_modified: bool = ..., file: _Optional[bytes] = ..., raw: _Optional[_Union[RawMesh, _Mapping]] = ..., doubted: _Optional[_Iterable[_Union[DoubtedContact, _Mapping]]] = ...) -> None: ...

class DoubtedContact(_message.Message):
    __slots__ = ("seq", "point", "doubt")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    POINT_FIELD_NUMBER: _ClassVar[int]
    DOUBT_FIELD_NUMBER: _ClassVar[int]
    seq: int
    point: _geometry_pb2.Vector3
    doubt: float
    def __init__(self, seq: _Optional[int] = ..., point: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., doubt: _Optional[float] = ...) -> None: ...

class RawMesh(_message.Message):
    __slots__ = ("n_vertices", "n_faces", "positions_f32_le", "faces_u32_le", "uncertainty_f32_le", "std_m_f32_le", "topology_etag")
    N_VERTICES_FIELD_NUMBER: _ClassVar[int]
    N_FACES_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_F32_LE_FIELD_NUMBER: _ClassVar[int]
    FACES_U32_LE_FIELD_NUMBER: _ClassVar[int]
    UNCERTAINTY_F32_LE_FIELD_NUMBER: _ClassVar[int]
    STD_M_F32_LE_FIELD_NUMBER: _ClassVar[int]
    TOPOLOGY_ETAG_FIELD_NUMBER: _ClassVar[int]
    n_vertices: int
    n_faces: int
    positions_f32_le: bytes
    faces_u32_le: bytes
    uncertainty_f32_le: bytes
    std_m_f32_le: bytes
    topology_etag: str
    def __init__(self, n_vertices: _Optional[int] = ..., n_faces: _Optional[int] = ..., positions_f32_le: _Optional[bytes] = ..., faces_u32_le: _Optional[bytes] = ..., uncertainty_f32_le: _Optional[bytes] = ..., std_m_f32_le: _Optional[bytes] = ..., topology_etag: _Optional[str] = ...) -> None: ...
