"""Things that a data set lists on the table of each observation, with where they lie."""

from __future__ import annotations

from typing import NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from cliport_policy.data.demonstrations import DemonstrationSet
from cliport_policy.data.encoded_rows import Place
from cliport_policy.errors import DataError


class ListedThing(NamedTuple):
    """Thing on the table.

    color: its colour's name, "" where it has none. rgb: 0xRRGGBB, its paint in full light. pixel: (row, col) of its
    middle, which may be hidden.
    """

    name: str
    color: str
    rgb: int
    pixel: tuple[int, int]


def read_listed_things(data: DemonstrationSet) -> dict[Place, tuple[ListedThing, ...]]:
    """Return what lies on the table in each row of a data set, by the row's place on disk.

    Raises:
        DataError: if the data set is of a version that lists nothing, or can't be read.
    """
    found: dict[Place, tuple[ListedThing, ...]] = {}
    for number, path in enumerate(sorted(data.folder.glob("part-*.parquet"))):
        try:
            with pq.ParquetFile(path) as file:
                for group in range(file.num_row_groups):
                    for row, values in enumerate(file.read_row_group(group, ["things"]).to_pylist()):
                        found[Place(number, group, row)] = tuple(_thing(one) for one in values["things"] or ())
        except (OSError, KeyError, pa.ArrowException) as error:
            raise DataError(
                f"{path} does not list the things on the table ({' '.join(str(error).split())[:120]}): generate the "
                "data set again with this version"
            ) from error
    if not any(found.values()):
        raise DataError(
            f"{data.folder} lists nothing on any table: generate the data set again, with this version and its tasks"
        )
    return found


def _thing(values: dict[str, object]) -> ListedThing:
    row, col, rgb = (int(str(values[name])) for name in ("row", "col", "rgb"))
    return ListedThing(str(values["name"]), str(values["color"] or ""), rgb, (row, col))
