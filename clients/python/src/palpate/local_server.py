"""A server of one's own, for notebooks and tests."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
import threading
from collections import deque
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import IO

HOW_TO_GET_IT = (
    "`pip install ./packaging/wheel` in a clone of Palpate installs it; or build it with `cargo build --release --locked`, "
    "and give its path (target/release/palpate) as `program`, as PALPATE_BINARY, or put it into the PATH"
)


class LocalServer:
    """A server that runs as long as this context, or until `stop`; `local_server` starts one.

    Attributes:
        url: for `Client`, and for a browser.
    """

    def __init__(
        self, program: str, database: Path, temporary: tempfile.TemporaryDirectory[str] | None, options: Sequence[str]
    ):
        self._temporary = temporary
        command = [program, "serve", "--database", str(database), "--log", "info", "--log-format", "json", *options]
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        self._last_lines: deque[str] = deque(maxlen=20)
        self.url = self._address()
        # The log goes on, and a full pipe would stop the server.
        threading.Thread(target=self._drain, args=(self._process.stderr,), daemon=True).start()

    def _address(self) -> str:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._last_lines.append(line)
            try:
                said = json.loads(line)
            except ValueError:
                continue
            if url := said.get("api") or said.get("fields", {}).get("api"):
                return str(url)
        self.stop()
        raise RuntimeError(f"the server ended before it listened:\n{''.join(self._last_lines)}")

    def _drain(self, log: IO[str]) -> None:
        with log:
            for line in log:
                self._last_lines.append(line)

    def __enter__(self) -> LocalServer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Stops the server; a database of its own is removed."""
        self._process.terminate()
        self._process.wait()
        if self._temporary:
            self._temporary.cleanup()

    def kill(self) -> None:
        """Kills the server, as a power cut does. What it acknowledged is in its database."""
        self._process.kill()
        self._process.wait()

    def __del__(self) -> None:
        if hasattr(self, "_process") and self._process.poll() is None:
            self._process.terminate()

    def __repr__(self) -> str:
        return f"<LocalServer {self.url}>"


def installed_program() -> str | None:
    """The program of the package `palpate-server`, which need not be in the PATH; `None` where it is not installed."""
    try:
        files = metadata.files("palpate-server") or []
    except metadata.PackageNotFoundError:
        return None
    programs = (Path(str(file.locate())) for file in files if file.name in ("palpate", "palpate.exe"))
    return next((str(program.resolve()) for program in programs if program.is_file()), None)


def local_server(
    program: str | Path | None = None, database: str | Path | None = None, port: int = 0, options: Sequence[str] = ()
) -> LocalServer:
    """Starts a server on this machine's loopback.

    Args:
        program: the path of `palpate`; by default PALPATE_BINARY, or the one that the package `palpate-server` installed,
            or the one in the PATH.
        database: an SQLite file that is kept; by default a temporary one.
        port: by default any free one.
        options: further ones of `palpate serve`.

    Raises:
        FileNotFoundError: the program is not found; the error says how to get it.
        RuntimeError: the server did not start; the error has its log.
    """
    wanted = str(program) if program else os.environ.get("PALPATE_BINARY") or installed_program() or "palpate"
    found = shutil.which(wanted)
    if found is None:
        raise FileNotFoundError(f"the program {wanted} is not there: {HOW_TO_GET_IT}")
    temporary = None if database else tempfile.TemporaryDirectory(prefix="palpate-")
    where = Path(database) if database else Path(temporary.name) / "palpate.db" if temporary else Path()
    return LocalServer(found, where, temporary, ["--listen", f"127.0.0.1:{port}", *options])
