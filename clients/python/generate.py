#!/usr/bin/env python3
"""Makes what is not written by hand: `python generate.py`.

The client that waits for each answer is the asyncio client without its `async` and `await`: src/palpate/client.py,
session.py and exploration.py come from those in src/palpate/aio.

The stubs in src/palpate/v1 come from the contract in proto/.
The generator is pinned to the last one whose stubs do not ask for a certain protobuf: stubs of later ones refuse every
protobuf that is two major versions newer.
It is installed into a folder of its own, as it needs an older protobuf than others do.
"""

from __future__ import annotations

import subprocess
import tempfile
import venv
from pathlib import Path

GENERATOR = ["grpcio-tools==1.62.3", "setuptools<81"]
HERE = Path(__file__).parent
CONTRACT = HERE.parent.parent / "proto"
STATUS_DETAILS = HERE / "src" / "palpate" / "status_details.proto"


#: What a word of the asyncio client is in the other one, in this order.
BLOCKING = [
    ("async def ", "def "),
    ("async with ", "with "),
    ("async for ", "for "),
    ("await ", ""),
    ("asyncio.sleep", "time.sleep"),
    ("import asyncio", "import time"),
    ("AsyncIterator, Awaitable, Callable, Iterable, Mapping", "Callable, Iterable, Iterator, Mapping"),
    ("AsyncIterator, Iterable, Mapping", "Iterable, Iterator, Mapping"),
    ("AsyncIterator", "Iterator"),
    ("Awaitable[Any]", "Any"),
    ("__aenter__", "__enter__"),
    ("__aexit__", "__exit__"),
    ("__aiter__", "__iter__"),
    ("grpc.aio.", "grpc."),
    ("connect_aio", "connect"),
    ("palpate.aio.", "palpate."),
]
GENERATED = ["client.py", "session.py", "exploration.py"]


def blocking(name: str) -> str:
    """The client that waits, from src/palpate/aio/`name`."""
    text = (HERE / "src" / "palpate" / "aio" / name).read_text()
    for word, other in BLOCKING:
        text = text.replace(word, other)
    return f"# Made by generate.py from aio/{name}: change that.\n{text}"


def stubs(folder: Path) -> None:
    """Writes the stubs as a package `palpate` below `folder`."""
    with tempfile.TemporaryDirectory() as temporary:
        venv.create(temporary, with_pip=True)
        python = str(Path(temporary) / "bin" / "python")
        subprocess.run(
            [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *GENERATOR], check=True
        )
        out = [f"--python_out={folder}", f"--pyi_out={folder}"]
        files = sorted((CONTRACT / "palpate" / "v1").glob("*.proto"))
        protoc = [python, "-m", "grpc_tools.protoc", f"-I{CONTRACT}", *out]
        subprocess.run([*protoc, f"--grpc_python_out={folder}", *files], check=True)
        subprocess.run([python, "-m", "grpc_tools.protoc", f"-I{HERE / 'src'}", *out, STATUS_DETAILS], check=True)
    made = folder / "palpate" / "v1"
    for stub in made.glob("*_pb2_grpc.py"):
        if "class " not in stub.read_text():  # a file without a service
            stub.unlink()
    names = [f"from .{file.stem}_pb2 import *" for file in files]
    (made / "__init__.py").write_text(
        '"""The messages of the wire contract, generated from proto/palpate/v1."""\n\n' + "\n".join(names) + "\n"
    )


if __name__ == "__main__":
    for name in GENERATED:
        (HERE / "src" / "palpate" / name).write_text(blocking(name))
    stubs(HERE / "src")
