"""What the package depends on, which differs with where it is built.

In a checkout the server is built with the client, from the same sources. PALPATE_SERVER=release asks for the published server
of the same version instead, for archives and wheels that are given away, and PALPATE_SERVER=off leaves the server out.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

NO_CARGO = """
The server is built with the client, and cargo, which builds it, is not in the PATH. Either
  install Rust, from https://rustup.rs, and gcc, and try again, or
  leave the server out: PALPATE_SERVER=off pip install ...
"""


class Dependencies(MetadataHookInterface):
    """Adds the server to the dependencies that pyproject.toml names."""

    def update(self, metadata: dict[str, Any]) -> None:
        metadata["dependencies"] = [*self.config["client"], *self._server(metadata["version"])]

    def _server(self, version: str) -> list[str]:
        wish = os.environ.get("PALPATE_SERVER", "")
        if wish not in ("", "off", "release"):
            raise ValueError(f"PALPATE_SERVER is {wish!r}: it may be `off`, `release`, or not set")
        if wish == "off":
            return []
        sources = Path(self.root).parents[1] / "packaging" / "wheel"
        if wish == "release" or not (sources / "pyproject.toml").is_file():
            return [f"palpate-server=={version}"]
        if shutil.which("cargo") is None:
            raise RuntimeError(NO_CARGO)
        return [f"palpate-server @ {sources.as_uri()}"]
