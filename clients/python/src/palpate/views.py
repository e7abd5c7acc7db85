"""What a camera saw, as a message: clouds as packed floats, depth images as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from palpate import v1
from palpate.poses import PoseLike, VectorLike, pose_message, vector_message

_FILES = {".ply": v1.POINT_ENCODING_PLY, ".pcd": v1.POINT_ENCODING_PCD}


def cloud(
    points: npt.ArrayLike | str | Path,
    viewpoint: VectorLike | None,
    voxel_m: float | None,
    uncertainty: float | None,
    keep_clutter: bool,
) -> v1.VisualPrior:
    """A view from an array of points (N, 3) in metres, or from a PLY or PCD file, which is sent as it is."""
    prior = v1.VisualPrior(keep_clutter=keep_clutter)
    if isinstance(points, str | Path):
        path = Path(points)
        encoding = _FILES.get(path.suffix.lower())
        if encoding is None:
            raise ValueError(f"points: {path.name} is neither a .ply nor a .pcd file")
        prior.encoding, prior.points = encoding, path.read_bytes()
    else:
        array = np.asarray(points)
        if array.ndim != 2 or array.shape[1] != 3 or not np.issubdtype(array.dtype, np.number):
            raise ValueError(
                f"points has the shape {array.shape} of {array.dtype}: (N, 3) numbers are expected, in metres"
            )
        # An integer cloud is one in millimetres; in metres it would be a handful of places.
        if np.issubdtype(array.dtype, np.integer):
            raise ValueError(f"points is of {array.dtype}: metres are expected; divide millimetres by 1000.0")
        if array.dtype.kind == "c":
            raise ValueError("points is complex: real numbers are expected")
        prior.encoding = v1.POINT_ENCODING_XYZ_F32_LE
        prior.points = np.ascontiguousarray(array, dtype="<f4").tobytes()
    if viewpoint is not None:
        prior.viewpoint.CopyFrom(vector_message(viewpoint, "viewpoint"))
    return _with_options(prior, voxel_m, uncertainty)


def depth_image(
    depth: npt.ArrayLike,
    intrinsics: npt.ArrayLike,
    base_from_camera: PoseLike,
    mask: npt.ArrayLike | None,
    depth_scale_m: float,
    depth_range_m: tuple[float, float] | None,
    voxel_m: float | None,
    uncertainty: float | None,
    keep_clutter: bool,
) -> v1.VisualPrior:
    """A view from a depth image; see `Session.add_depth`."""
    image = np.asarray(depth)
    if image.ndim != 2:
        raise ValueError(f"depth has the shape {image.shape}: (rows, columns) is expected")
    if image.dtype.kind == "f":
        raise ValueError(f"depth is of {image.dtype}: whole units are expected, as cameras store them; "
                         "metres in floats become them by numpy.nan_to_num(depth * 1000).astype('uint16')")  # fmt: skip
    if image.dtype.kind not in "ui" or image.size and (image.min() < 0 or image.max() > 65535):
        raise ValueError(f"depth is of {image.dtype}: 16-bit unsigned integers are expected")
    fx, fy, cx, cy = _intrinsics(intrinsics)
    rows, columns = image.shape
    if not depth_scale_m > 0:
        raise ValueError(
            f"depth_scale_m is {depth_scale_m}: the metres of one unit are expected, 0.001 for millimetres"
        )
    message = v1.DepthImage(width=columns, height=rows, fx=fx, fy=fy, cx=cx, cy=cy, depth_scale_m=depth_scale_m)
    message.base_from_camera.CopyFrom(pose_message(base_from_camera, "base_from_camera"))
    if mask is not None:
        where = np.asarray(mask)
        if where.shape != image.shape:
            raise ValueError(
                f"mask has the shape {where.shape} and depth {image.shape}: one value for each pixel is expected"
            )
        message.mask_u8 = (where != 0).astype("u1").tobytes()
    if depth_range_m is not None:
        message.min_depth_m, message.max_depth_m = depth_range_m
    prior = v1.VisualPrior(
        encoding=v1.POINT_ENCODING_DEPTH_U16,
        points=np.ascontiguousarray(image, dtype="<u2").tobytes(),
        depth=message,
        keep_clutter=keep_clutter,
    )
    return _with_options(prior, voxel_m, uncertainty)


def _intrinsics(value: npt.ArrayLike) -> tuple[float, float, float, float]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape == (3, 3):
        return float(array[0, 0]), float(array[1, 1]), float(array[0, 2]), float(array[1, 2])
    if array.shape == (4,):
        fx, fy, cx, cy = (float(x) for x in array)
        return fx, fy, cx, cy
    raise ValueError(
        f"intrinsics has the shape {array.shape}: a 3x3 camera matrix or (fx, fy, cx, cy), in pixels, is expected"
    )


def _with_options(prior: v1.VisualPrior, voxel_m: float | None, uncertainty: float | None) -> v1.VisualPrior:
    if voxel_m is not None:
        prior.voxel_m = voxel_m
    if uncertainty is not None:
        prior.uncertainty = uncertainty
    return prior
