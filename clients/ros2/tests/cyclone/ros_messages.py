"""The messages of ROS 2 as an independent DDS has them: field by field from their definitions, not from the bridge."""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, int64, sequence, uint8, uint32, uint64


def ros(name: str) -> str:
    """The name on the wire of `package/msg/Name` or `package/srv/Name_Request`."""
    package, kind, message = name.split("/")
    return f"{package}::{kind}::dds_::{message}_"


@dataclass
class Time(IdlStruct, typename=ros("builtin_interfaces/msg/Time")):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename=ros("std_msgs/msg/Header")):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3(IdlStruct, typename=ros("geometry_msgs/msg/Vector3")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename=ros("geometry_msgs/msg/Point")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename=ros("geometry_msgs/msg/Quaternion")):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename=ros("geometry_msgs/msg/Pose")):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename=ros("geometry_msgs/msg/PoseStamped")):
    header: Header
    pose: Pose


@dataclass
class PoseArray(IdlStruct, typename=ros("geometry_msgs/msg/PoseArray")):
    header: Header
    poses: sequence[Pose]


@dataclass
class Wrench(IdlStruct, typename=ros("geometry_msgs/msg/Wrench")):
    force: Vector3 = field(default_factory=Vector3)
    torque: Vector3 = field(default_factory=Vector3)


@dataclass
class WrenchStamped(IdlStruct, typename=ros("geometry_msgs/msg/WrenchStamped")):
    header: Header
    wrench: Wrench


@dataclass
class Transform(IdlStruct, typename=ros("geometry_msgs/msg/Transform")):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename=ros("geometry_msgs/msg/TransformStamped")):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename=ros("tf2_msgs/msg/TFMessage")):
    transforms: sequence[TransformStamped]


@dataclass
class PointField(IdlStruct, typename=ros("sensor_msgs/msg/PointField")):
    name: str
    offset: uint32
    datatype: uint8
    count: uint32


@dataclass
class PointCloud2(IdlStruct, typename=ros("sensor_msgs/msg/PointCloud2")):
    header: Header
    height: uint32
    width: uint32
    fields: sequence[PointField]
    is_bigendian: bool
    point_step: uint32
    row_step: uint32
    data: sequence[uint8]
    is_dense: bool


@dataclass
class Image(IdlStruct, typename=ros("sensor_msgs/msg/Image")):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class RegionOfInterest(IdlStruct, typename=ros("sensor_msgs/msg/RegionOfInterest")):
    x_offset: uint32 = 0
    y_offset: uint32 = 0
    height: uint32 = 0
    width: uint32 = 0
    do_rectify: bool = False


@dataclass
class CameraInfo(IdlStruct, typename=ros("sensor_msgs/msg/CameraInfo")):
    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]
    k: array[float64, 9]
    r: array[float64, 9]
    p: array[float64, 12]
    binning_x: uint32 = 0
    binning_y: uint32 = 0
    roi: RegionOfInterest = field(default_factory=RegionOfInterest)


@dataclass
class CompressedImage(IdlStruct, typename=ros("sensor_msgs/msg/CompressedImage")):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
class ColorRGBA(IdlStruct, typename=ros("std_msgs/msg/ColorRGBA")):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
class Duration(IdlStruct, typename=ros("builtin_interfaces/msg/Duration")):
    sec: int32
    nanosec: uint32


@dataclass
class UVCoordinate(IdlStruct, typename=ros("visualization_msgs/msg/UVCoordinate")):
    u: float32
    v: float32


@dataclass
class MeshFile(IdlStruct, typename=ros("visualization_msgs/msg/MeshFile")):
    filename: str
    data: sequence[uint8]


@dataclass
class Marker(IdlStruct, typename=ros("visualization_msgs/msg/Marker")):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: sequence[Point]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
class MeshTriangle(IdlStruct, typename=ros("shape_msgs/msg/MeshTriangle")):
    vertex_indices: array[uint32, 3]


@dataclass
class Mesh(IdlStruct, typename=ros("shape_msgs/msg/Mesh")):
    triangles: sequence[MeshTriangle]
    vertices: sequence[Point]


@dataclass
class KeyValue(IdlStruct, typename=ros("diagnostic_msgs/msg/KeyValue")):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename=ros("diagnostic_msgs/msg/DiagnosticStatus")):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename=ros("diagnostic_msgs/msg/DiagnosticArray")):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class Contact(IdlStruct, typename=ros("palpate_msgs/msg/Contact")):
    header: Header
    kind: uint8 = 0
    candidate_id: str = ""
    sensor_id: str = ""
    has_pose: bool = False
    pose: Pose = field(default_factory=Pose)
    has_wrench: bool = False
    wrench: Wrench = field(default_factory=Wrench)
    rest_wrench: Wrench = field(default_factory=Wrench)
    has_sweep: bool = False
    swept_from: Point = field(default_factory=Point)
    swept_to: Point = field(default_factory=Point)
    sweep_radius_m: float64 = 0.0
    has_normal: bool = False
    normal: Vector3 = field(default_factory=Vector3)
    has_uncertainty: bool = False
    uncertainty: float64 = 0.0
    detail: str = ""


@dataclass
class Candidate(IdlStruct, typename=ros("palpate_msgs/msg/Candidate")):
    candidate_id: str
    sensor_id: str
    point: Point
    normal: Vector3
    probe_start: Point
    probe_end: Point
    tool_pose: Pose
    score: float64
    uncertainty: float64
    std_m: float64
    failure_risk: float64
    why: str


@dataclass
class Candidates(IdlStruct, typename=ros("palpate_msgs/msg/Candidates")):
    header: Header
    session_id: str
    revision: int64
    should_stop: str
    candidates: sequence[Candidate]


# Requests and replies as rmw_cyclonedds_cpp sends them: who asked, and the number of the call, come first.


@dataclass
class TriggerRequest(IdlStruct, typename=ros("std_srvs/srv/Trigger_Request")):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8 = 0


@dataclass
class TriggerResponse(IdlStruct, typename=ros("std_srvs/srv/Trigger_Response")):
    client: uint64
    number: int64
    success: bool
    message: str


@dataclass
class CreateSessionRequest(IdlStruct, typename=ros("palpate_msgs/srv/CreateSession_Request")):
    client: uint64
    number: int64
    session_id: str = ""
    display_name: str = ""
    experiment: str = ""
    config: str = ""


@dataclass
class CreateSessionResponse(IdlStruct, typename=ros("palpate_msgs/srv/CreateSession_Response")):
    client: uint64
    number: int64
    success: bool
    message: str
    session_id: str


@dataclass
class ProposeRequest(IdlStruct, typename=ros("palpate_msgs/srv/Propose_Request")):
    client: uint64
    number: int64
    top_k: uint32 = 0


@dataclass
class ProposeResponse(IdlStruct, typename=ros("palpate_msgs/srv/Propose_Response")):
    client: uint64
    number: int64
    success: bool
    message: str
    revision: int64


@dataclass
class RejectRequest(IdlStruct, typename=ros("palpate_msgs/srv/Reject_Request")):
    client: uint64
    number: int64
    candidate_id: str = ""
    reason: uint8 = 0
    detail: str = ""


@dataclass
class RejectResponse(IdlStruct, typename=ros("palpate_msgs/srv/Reject_Response")):
    client: uint64
    number: int64
    success: bool
    message: str
    revision: int64


@dataclass
class FinishRequest(IdlStruct, typename=ros("palpate_msgs/srv/Finish_Request")):
    client: uint64
    number: int64
    note: str = ""


@dataclass
class FinishResponse(IdlStruct, typename=ros("palpate_msgs/srv/Finish_Response")):
    client: uint64
    number: int64
    success: bool
    message: str
