"""What is remembered of a stream while it runs, so that it can go on over a new connection."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from palpate import calls, v1
from palpate.candidates import Candidate
from palpate.errors import NoAnswer
from palpate.mesh import Mesh

CHUNK_BYTES = 1 << 20
_ARCHIVES = {
    "bundle": v1.ARCHIVE_FORMAT_BUNDLE,
    "mcap": v1.ARCHIVE_FORMAT_MCAP,
    "csv": v1.ARCHIVE_FORMAT_CSV,
}
_ARCHIVE_SUFFIXES = {".tar": "bundle", ".palpate": "bundle", ".mcap": "mcap", ".csv": "csv"}


@dataclass(frozen=True, eq=False)
class Update:
    """One step of a session.

    Attributes:
        event: an accepted event, or `None` where this is the mesh after the one before.
        mesh: the estimate after the event before, or `None`.
        session: the session after the event.
        candidates: the best places to touch after it; may be left out.
        hash_matches: in a verifying replay, whether the computed state is the one that the log recorded.
    """

    event: v1.Event | None
    mesh: Mesh | None
    session: v1.Session
    candidates: tuple[Candidate, ...]
    hash_matches: bool

    @staticmethod
    def read(reply: v1.WatchSessionResponse) -> Update | None:
        """An update from its message; `None` for a sign of life."""
        kind = reply.WhichOneof("update")
        if kind not in ("event", "mesh"):
            return None
        return Update(
            event=reply.event if kind == "event" else None,
            mesh=Mesh.read(reply.mesh) if kind == "mesh" else None,
            session=reply.session,
            candidates=tuple(Candidate.read(message, reply.session.config.sensors) for message in reply.candidates),
            hash_matches=reply.hash_matches,
        )


class Watching:
    """A watch: after a broken connection it is asked for again, after the last event that arrived."""

    def __init__(self, session_id: str, after_revision: int, include_mesh: bool):
        self._session_id, self._after, self._include_mesh = session_id, after_revision, include_mesh

    def call(self) -> calls.Call[v1.WatchSessionResponse]:
        """What to ask now."""
        return calls.watch_session(self._session_id, self._after, self._include_mesh)

    def read(self, reply: v1.WatchSessionResponse) -> Update | None:
        """Takes note of what arrived."""
        if reply.WhichOneof("update") == "event":
            self._after = reply.event.seq
        return Update.read(reply)


def archive_format(path: Path, format: str | None) -> v1.ArchiveFormat:
    """The format of an export: the given one, or that of the file's suffix."""
    name = format or _ARCHIVE_SUFFIXES.get(path.suffix.lower(), "")
    if name.lower() not in _ARCHIVES:
        raise ValueError(
            f"format is {format!r} and the file {path.name}: say bundle (.tar), mcap (.mcap) or csv (.csv)"
        )
    return _ARCHIVES[name.lower()]


class Saving:
    """A file that arrives in parts, as a context: it has its name when it is whole, and is not there before.

    Raises:
        NoAnswer: at the end, where it was cut or changed on the way.
    """

    def __init__(self, path: Path):
        self._path = path
        self._part = path.with_name(f"{path.name}.part")
        self._digest = hashlib.sha256()
        self._expected = ""

    def __enter__(self) -> Saving:
        self._file = self._part.open("wb")
        return self

    def write(self, chunk: v1.Chunk) -> None:
        """Appends what arrived."""
        self._file.write(chunk.data)
        self._digest.update(chunk.data)
        self._expected = chunk.sha256

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
        is_whole = self._expected == self._digest.hexdigest()
        if kind is None and is_whole:
            self._part.replace(self._path)
            return
        self._part.unlink()
        if kind is None:
            raise NoAnswer("the file was cut or changed on the way: its SHA-256 is not the one that was sent", 1)


def import_requests(path: Path, header: v1.CreateSessionRequest) -> Iterator[v1.ImportSessionRequest]:
    """The messages that bring a bundle."""
    yield v1.ImportSessionRequest(header=header)
    with path.open("rb") as file:
        while data := file.read(CHUNK_BYTES):
            yield v1.ImportSessionRequest(data=data)
