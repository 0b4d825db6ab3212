"""IGES files (version 5.3) through OCCT."""

import io
import os
from pathlib import Path
from typing import Any

from .._atomic import check_writable, replacing
from .._errors import InputError
from ._occt import topologies
from ._occt_session import occt, quiet_session
from ._units import MILLIMETRES, OCCT_UNITS, check_unit


def write_iges(path: str | os.PathLike, shapes: Any, *, unit: str = "mm") -> None:
    """Write one shape or a list of shapes to an IGES file, in their order.

    `shapes`: B-spline and NURBS curves in space (entity 126) and surfaces (128, bounded by 144), trimmed
    surfaces (142). Numbers in the file are the shapes' own, bit for bit; `unit` ("mm", "cm", "m" or "in")
    says what they mean. Periodic and unclamped shapes are written clamped. STEP is the better format where
    the reader knows both.
    Raises `InputError` for other shapes, values that are not finite, unknown units or bad paths.
    """
    path = Path(path)
    unit = check_unit(unit)
    check_writable(path)
    with quiet_session({}):
        parts = topologies(shapes, function="write_iges")
        writer = occt("IGESControl").IGESControl_Writer(OCCT_UNITS[unit], 0)
        model = writer.Model()
        header = model.GlobalSection()
        header.SetCascadeUnit(MILLIMETRES[unit])  # so that no number is scaled
        string = occt("TCollection").TCollection_HAsciiString
        header.SetFileName(string(path.name.encode("ascii", "replace").decode()))
        header.SetAuthorName(string("jaxsurf"))  # else OCCT states the name of the user's account
        model.SetGlobalSection(header)
        for part in parts:
            if not writer.AddShape(part):
                raise InputError("write_iges: OCCT cannot translate one of these shapes to IGES; write STEP instead.")
        writer.ComputeModel()
        text = occt("IGESData").IGESData_IGESWriter(writer.Model())
        # OCCT's own format stops after 10 digits.
        text.FloatWriter().SetFormat("%.16E")
        text.SendModel(writer.Model().Protocol())
        stream = io.BytesIO()
        text.Print(stream)
    with replacing(path) as temporary:
        temporary.write_bytes(stream.getvalue())
