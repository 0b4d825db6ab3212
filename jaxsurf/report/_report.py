"""What a report says, as plain data."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from .._errors import InputError

PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True)
class Table:
    """A table of text or numbers under a caption; every row has as many cells as `columns`."""

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]

    def __post_init__(self):
        for i, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise InputError(
                    f"`rows[{i}]` of the table {self.caption!r} must have {len(self.columns)} cells, got {len(row)}."
                )


@dataclass(frozen=True)
class Report:
    """The content of a report about one fit; any room can fill one in.

    title: the heading; summary: (label, value, unit) per figure, numbers or text; deviations: (n,) signed, in
    `unit`, for the histogram, or `None`; pictures: (caption, bytes of a PNG file); tables: e.g. the history
    of the refinement; provenance: (label, text), how it was made; notes: sentences set off under the heading.
    Raises `InputError` on pictures that are no PNG, on deviations that are not finite and on tables with
    uneven rows.
    """

    title: str
    summary: Sequence[tuple[str, object, str]] = ()
    deviations: Float[np.ndarray, "n"] | None = None
    unit: str = "mm"
    pictures: Sequence[tuple[str, bytes]] = ()
    tables: Sequence[Table] = ()
    provenance: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = field(default=())

    def __post_init__(self):
        for i, (caption, picture) in enumerate(self.pictures):
            if not bytes(picture[:8]) == PNG:
                raise InputError(f"`pictures[{i}]` ({caption!r}) must be the bytes of a PNG file.")
        if self.deviations is not None:
            values = np.asarray(self.deviations)
            if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
                raise InputError(f"`deviations` must be finite numbers of shape (n,), n > 0, got shape {values.shape}.")
