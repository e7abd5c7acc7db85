"""Arguments that the wire contract has as enumerations, with and without their prefix, and as counts."""

from __future__ import annotations

from typing import Any, SupportsIndex


def count(value: int, argument: str) -> int:
    """`value` as a count.

    Raises:
        ValueError: it is negative or no whole number; the error calls it `argument`.
    """
    if not isinstance(value, SupportsIndex) or not 0 <= value.__index__() < 2**32:
        raise ValueError(f"{argument} is {value!r}: a whole number, 0 or more, is expected")
    return value.__index__()


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
