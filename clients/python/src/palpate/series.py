"""One row for each view and attempt of a session, for charts and tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from palpate import v1

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Series:
    """The rows of a session, in the order of its log.

    Attributes:
        columns: an array (rows,) for each name: revision, attempt, outcome, candidate_id, robot_id, append_time (UTC),
            duration_s, mean_uncertainty, max_uncertainty, mean_std_m, failures, surface_distance_m, force_n, doubted,
            retracted_by_seq. Lengths are metres; NaN is what is not known, such as the distance without a reference.
        rows: the messages, with what the shadow strategies would have touched.
        errors_pending: rows whose distance from the reference is still being computed.
    """

    columns: dict[str, npt.NDArray[Any]]
    rows: tuple[v1.SeriesRow, ...]
    errors_pending: int

    @staticmethod
    def read(message: v1.GetSeriesResponse) -> Series:
        """The series of a reply."""
        return Series(_columns(message.rows), tuple(message.rows), message.errors_pending)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        return self.columns[name]

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a `pandas.DataFrame`, by revision.

        Raises:
            ImportError: pandas is not installed: `pip install "palpate[pandas]"`.
        """
        try:
            import pandas
        except ImportError:
            raise ImportError('to_pandas needs pandas: pip install "palpate[pandas]"') from None
        return pandas.DataFrame(self.columns).set_index("revision")


def _columns(rows: Iterable[v1.SeriesRow]) -> dict[str, npt.NDArray[Any]]:
    kept = list(rows)

    def optional(name: str) -> npt.NDArray[np.float64]:
        return np.array([getattr(row, name) if row.HasField(name) else np.nan for row in kept], dtype=np.float64)

    def column(name: str, kind: npt.DTypeLike) -> npt.NDArray[Any]:
        return np.array([getattr(row, name) for row in kept], dtype=kind)

    times = [row.append_time.ToNanoseconds() for row in kept]
    return {
        "revision": column("revision", np.int64),
        "attempt": column("attempt", np.int64),
        "outcome": column("outcome", object),
        "candidate_id": column("candidate_id", object),
        "robot_id": column("robot_id", object),
        "append_time": np.array(times, dtype="datetime64[ns]"),
        "duration_s": np.array([row.duration.ToNanoseconds() / 1e9 for row in kept], dtype=np.float64),
        "mean_uncertainty": column("mean_uncertainty", np.float64),
        "max_uncertainty": column("max_uncertainty", np.float64),
        "mean_std_m": optional("mean_std_m"),
        "failures": column("failures", np.int64),
        "surface_distance_m": optional("surface_distance_m"),
        "force_n": optional("force_n"),
        "doubted": column("doubted", np.bool_),
        "retracted_by_seq": column("retracted_by_seq", np.int64),
    }
