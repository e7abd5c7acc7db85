"""What generate.py made is what it makes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent
sys.path.insert(0, str(PACKAGE))
import generate  # noqa: E402


@pytest.mark.parametrize("name", generate.GENERATED)
def test_the_client_that_waits_is_the_asyncio_client_without_await(name: str) -> None:
    text = generate.blocking(name)
    assert (PACKAGE / "src" / "palpate" / name).read_text() == text, "run generate.py"
    assert not [word for word in ("async", "await ", "Async", "grpc.aio") if word in text]


def test_the_stubs_are_those_of_the_contract(tmp_path: Path) -> None:
    generate.stubs(tmp_path)
    made = {path.relative_to(tmp_path): path.read_text() for path in sorted(tmp_path.rglob("*.py*"))}
    kept = {path: (PACKAGE / "src" / path).read_text() for path in made}
    assert kept == made, "run generate.py"
    folder = PACKAGE / "src" / "palpate" / "v1"
    assert {path.name for path in folder.iterdir() if path.is_file()} == {
        path.name for path in made if path.parent.name == "v1"
    }
