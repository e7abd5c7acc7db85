"""The table of reasons in clients/README.md is what this client does."""

from __future__ import annotations

from pathlib import Path

import grpc
import pytest

from palpate.errors import HINTS, Refused

PAGE = Path(__file__).parents[2] / "README.md"
ROWS = [
    [cell.strip() for cell in line.strip("|\n").split("|")]
    for line in PAGE.read_text().splitlines()
    if line.startswith("| `")
]
REASONS = [
    (reason.strip("`"), code, again, todo) for reason, code, _, again, todo in (row for row in ROWS if len(row) == 5)
]


@pytest.mark.parametrize(("reason", "code", "again", "todo"), [row for row in REASONS if row[1] != "-"])
def test_a_reason_is_dealt_with_as_the_table_says(reason: str, code: str, again: str, todo: str) -> None:
    wait = 0.1 if again == "after the wait" else None
    refused = Refused(grpc.StatusCode[code], reason, "no", retry_after=wait)
    assert refused.is_transient() == (again != "no")
    assert refused.hint == todo


def test_each_hint_is_of_a_reason() -> None:
    assert set(HINTS) == {row[0] for row in REASONS if row[1] != "-"}
