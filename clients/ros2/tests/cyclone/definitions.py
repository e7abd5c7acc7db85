#!/usr/bin/env python3
"""Holds the definitions of palpate_msgs against the messages of the test: `definitions.py FOLDER`.

The round trip shows that the bridge speaks as the test's messages are; this shows that they are as the definitions say.
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path

# What each built-in type of a definition is called in the test's messages.
TYPES = {
    "string": "str", "bool": "bool", "float64": "float64", "uint8": "uint8", "uint32": "uint32", "int64": "int64",
    "std_msgs/Header": "Header", "geometry_msgs/Pose": "Pose", "geometry_msgs/Point": "Point",
    "geometry_msgs/Vector3": "Vector3", "geometry_msgs/Wrench": "Wrench", "Candidate[]": "sequence[Candidate]",
}  # fmt: skip


def defined(text: str) -> list[tuple[str, str]]:
    """Names and types of the fields, constants left out."""
    lines = (line.split("#")[0].split() for line in text.splitlines())
    return [(words[1], TYPES[words[0]]) for words in lines if len(words) == 2 and "=" not in words[1]]


def written(message: ast.ClassDef) -> list[tuple[str, str]]:
    """The same of a message of the test, without what the RMW puts in front."""
    fields = [(one.target.id, ast.unparse(one.annotation)) for one in message.body if isinstance(one, ast.AnnAssign)]
    return [one for one in fields if one[0] not in ("client", "number")]


folder = Path(sys.argv[1])
source = ast.parse((Path(__file__).parent / "ros_messages.py").read_text())
messages = {one.name: written(one) for one in source.body if isinstance(one, ast.ClassDef)}
checked = 0
for file in sorted([*folder.glob("msg/*.msg"), *folder.glob("srv/*.srv")]):
    parts = file.read_text().split("\n---\n")
    names = [file.stem] if file.suffix == ".msg" else [f"{file.stem}Request", f"{file.stem}Response"]
    assert len(parts) == len(names), file
    for part, name in zip(parts, names):
        assert defined(part) == messages[name], (file, defined(part), messages[name])
        checked += 1
    assert file.name in (folder / "CMakeLists.txt").read_text(), f"{file} is not built"
print(f"{checked} definitions are as they are on the wire")
