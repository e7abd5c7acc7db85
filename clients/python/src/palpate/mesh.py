"""The estimated surface as NumPy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from palpate import v1

if TYPE_CHECKING:
    import trimesh

#: File formats by the suffix of their names.
SUFFIXES = {
    ".ply": v1.MESH_FORMAT_PLY,
    ".obj": v1.MESH_FORMAT_OBJ,
    ".stl": v1.MESH_FORMAT_STL,
    ".glb": v1.MESH_FORMAT_GLB,
}


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed triangle mesh, outward oriented; metres, in the session's frame. The arrays are read-only.

    Attributes:
        revision: of the session whose estimate it is.
        vertices: (V, 3) float32, metres.
        faces: (F, 3) uint32, counter-clockwise seen from outside.
        uncertainty: (V,) float32, in [0, 1].
        std_m: (V,) float32, standard deviation along the normal in metres; `None` where the method states none.
        doubted: contacts that contradict what else is known: seq, point and doubt.
    """

    revision: int
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    uncertainty: npt.NDArray[np.float32]
    std_m: npt.NDArray[np.float32] | None
    doubted: tuple[v1.DoubtedContact, ...]

    @staticmethod
    def read(message: v1.Mesh) -> Mesh:
        """A mesh from a message with packed arrays."""
        raw = message.raw
        std = np.frombuffer(raw.std_m_f32_le, "<f4")
        return Mesh(
            revision=message.revision,
            vertices=np.frombuffer(raw.positions_f32_le, "<f4").reshape(-1, 3),
            faces=np.frombuffer(raw.faces_u32_le, "<u4").reshape(-1, 3),
            uncertainty=np.frombuffer(raw.uncertainty_f32_le, "<f4"),
            std_m=std if len(std) else None,
            doubted=tuple(message.doubted),
        )

    def colors(self) -> npt.NDArray[np.uint8]:
        """(V, 4) RGBA of the vertices by uncertainty: green, yellow, red, as in the paper."""
        u = np.clip(self.uncertainty, 0.0, 1.0)
        red, green = np.minimum(2 * u, 1.0), np.minimum(2 - 2 * u, 1.0)
        return np.column_stack([220 * red, 200 * green, np.full_like(u, 40), np.full_like(u, 255)]).astype(np.uint8)

    def to_trimesh(self) -> trimesh.Trimesh:
        """The same as a `trimesh.Trimesh`, with vertex colours and `uncertainty` and `std_m` as vertex attributes.

        Raises:
            ImportError: trimesh is not installed: `pip install "palpate[mesh]"`.
        """
        try:
            import trimesh
        except ImportError:
            raise ImportError('to_trimesh needs trimesh: pip install "palpate[mesh]"') from None
        attributes: dict[str, Any] = {"uncertainty": self.uncertainty}
        if self.std_m is not None:
            attributes["std_m"] = self.std_m
        return trimesh.Trimesh(
            self.vertices, self.faces, process=False, vertex_colors=self.colors(), vertex_attributes=attributes
        )


def file_bytes(mesh: Any, argument: str = "mesh") -> bytes:
    """A reference surface as the bytes of a file: of a path, of bytes, or of anything with trimesh's `export`."""
    if isinstance(mesh, bytes | bytearray):
        return bytes(mesh)
    if isinstance(mesh, str | Path):
        return Path(mesh).read_bytes()
    if hasattr(mesh, "export"):
        return bytes(mesh.export(file_type="ply"))
    raise TypeError(
        f"{argument} is a {type(mesh).__name__}: the path or the bytes of a PLY, STL or OBJ file, or a trimesh, is expected"
    )
