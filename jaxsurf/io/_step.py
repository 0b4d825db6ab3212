"""STEP files (ISO 10303-21, schema AP242) through OCCT."""

import functools
import io
import os
from pathlib import Path
from typing import Any

from .._atomic import check_writable, replacing
from .._errors import InputError
from ._occt import topology
from ._occt_session import occt, quiet_session
from ._shape_list import each_shape
from ._units import check_unit

OCCT_UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH"}


def write_step(path: str | os.PathLike, shapes: Any, *, unit: str = "mm", name: str | None = None) -> None:
    path = Path(path)
    unit = OCCT_UNITS[check_unit(unit)]
    name = path.stem if name is None else name
    check_writable(path)
    settings = {
        "write.step.schema": "AP242DIS",
        "write.step.unit": unit,
        "xstep.cascade.unit": unit,
        "write.step.product.name": name,
        "write.precision.mode": "Greatest",
    }
    with quiet_session(settings):
        parts = each_shape(shapes, functools.partial(topology, function="write_step"), function="write_step")
        writer = occt("STEPControl").STEPControl_Writer()
        as_is = occt("STEPControl").STEPControl_StepModelType.STEPControl_AsIs
        builder, whole = occt("BRep").BRep_Builder(), occt("TopoDS").TopoDS_Compound()
        builder.MakeCompound(whole)
        for part in parts:
            builder.Add(whole, part)
        print(writer.Transfer(whole, as_is))
        stream = io.BytesIO()
        print(writer.WriteStream(stream))
    with replacing(path) as temporary:
        temporary.write_bytes(stream.getvalue())
