"""Which program a server of one's own is."""

from __future__ import annotations

from pathlib import Path

import pytest

import palpate
from palpate.local_server import installed_program


def install(folder: Path, package: str) -> Path:
    """A package `package` in `folder` that brings a program, as pip installs one; the program's path."""
    program = folder / "bin" / "palpate"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\necho no server >&2\n")
    program.chmod(0o755)
    about = folder / "site" / f"{package.replace('-', '_')}-1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
    (about / "RECORD").write_text("../bin/palpate,,\n")
    return program


def test_the_program_of_the_package_is_found_although_it_is_not_in_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = install(tmp_path, "palpate-server")
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.delenv("PALPATE_BINARY", raising=False)
    assert installed_program() == str(program)
    with pytest.raises(RuntimeError, match="no server"):
        palpate.local_server()
    program.unlink()
    assert installed_program() is None


def test_where_there_is_none_the_error_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "something-else")
    monkeypatch.syspath_prepend(tmp_path / "site")
    monkeypatch.delenv("PALPATE_BINARY", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert installed_program() is None
    with pytest.raises(FileNotFoundError, match="pip install"):
        palpate.local_server()
