"""The names of the wire contract's enumerations, with and without their prefix."""

from __future__ import annotations

from typing import Any, TypeVar

Value = TypeVar("Value", bound=int)


def enum_value(kind: Any, name: str, argument: str) -> Any:
    """The value of the enumeration `kind` that is called `name`: METHOD_PAPER, PAPER or paper.

    Raises:
        ValueError: there is none; the error calls it `argument`, and says which there are.
    """
    prefix = kind.DESCRIPTOR.values[0].name.removesuffix("UNSPECIFIED")
    wanted = prefix + str(name).upper().replace("-", "_").removeprefix(prefix)
    known = [value.name for value in kind.DESCRIPTOR.values if value.number]
    if wanted not in known:
        raise ValueError(
            f"{argument} is {name!r}; there are {', '.join(value.removeprefix(prefix) for value in known)}"
        )
    return kind.Value(wanted)
