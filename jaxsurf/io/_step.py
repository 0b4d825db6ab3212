"""STEP files (ISO 10303-21, schema AP242) through OCCT."""

import contextlib
import functools
import io
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .._atomic import check_writable, replacing
from .._errors import InputError
from ._occt import topologies
from ._occt_read import shapes_of
from ._occt_session import occt, quiet_session
from ._source import read_bytes, refusal
from ._step_check import check_entities, check_whole
from ._units import MILLIMETRES, OCCT_UNITS, check_unit


def write_step(path: str | os.PathLike, shapes: Any, *, unit: str = "mm", name: str | None = None) -> None:
    """Write one shape or a list of shapes as one part of a STEP file (AP242).

    `shapes`: B-spline and NURBS curves in space (free edges) and surfaces (faces), trimmed surfaces (faces
    with their loops in the parameter plane and as edges in space, fitted to 1e-8 of their size); the file
    lists the surfaces before the curves. Numbers in the file are the shapes' own, bit for bit, and `unit`
    ("mm", "cm", "m" or "in") says what they mean. Periodic and unclamped shapes are written clamped.
    `name`: of the part, default the file's name.
    Raises `InputError` for other shapes, values that are not finite, unknown units or bad paths.
    """
    path = Path(path)
    unit = check_unit(unit)
    check_writable(path)
    settings = {
        "write.step.schema": "AP242DIS",
        "write.step.unit": OCCT_UNITS[unit],
        "xstep.cascade.unit": OCCT_UNITS[unit],
        "write.precision.mode": "Max",
        "write.step.assembly": "Off",
    }
    with quiet_session(settings):
        builder, part = occt("BRep").BRep_Builder(), occt("TopoDS").TopoDS_Compound()
        builder.MakeCompound(part)
        for topology in topologies(shapes, function="write_step"):
            builder.Add(part, topology)
        control = occt("STEPControl")
        writer = control.STEPControl_Writer()
        if writer.Transfer(part, control.STEPControl_StepModelType.STEPControl_AsIs) != _done():
            raise InputError("write_step: OCCT cannot translate these shapes to STEP; write them one by one to find which.")
        content = _text(writer.Model(), path.stem if name is None else name)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def read_step(path: str | os.PathLike, *, unit: str | None = None) -> list[Any]:
    """Every face and every free edge of a STEP file as a list of shapes.

    Faces become B-spline or NURBS surfaces (planes, cylinders, cones, spheres and tori exactly so), as
    `TrimmedSurface` unless the outline is the border of a parameter box; S_u × S_v points outwards. Free
    edges become curves. Lengths are in the file's own unit (`step_unit` tells it), or in `unit` if given.
    Raises `InputError` for a file that is missing, empty, cut, no STEP file or without shapes; warns of faces
    that cannot be read.
    """
    length = None if unit is None else MILLIMETRES[check_unit(unit)]
    with _opened(path) as (reader, faces):
        reader.SetSystemLengthUnit(_file_unit(reader) if length is None else length)
        reader.TransferRoots()
        shapes = shapes_of(reader.OneShape(), source=str(path), faces=faces) if reader.NbShapes() else []
    if not shapes:
        raise refusal(path, "the STEP file holds no faces and no curves; export surfaces or solids, not a mesh")
    return shapes


def step_unit(path: str | os.PathLike) -> str:
    """The unit of length of a STEP file: "mm", "cm", "m", "in", or another one in the form "304.8 mm"."""
    with _opened(path) as (reader, _):
        length = _file_unit(reader)
    names = [name for name, millimetres in MILLIMETRES.items() if abs(length / millimetres - 1) < 1e-12]
    return names[0] if names else f"{length:.12g} mm"


@contextlib.contextmanager
def _opened(path: str | os.PathLike) -> Iterator[tuple[Any, int]]:
    data = read_bytes(path)
    faces = check_whole(path, data)
    with quiet_session({"xstep.cascade.unit": "MM"}):
        reader = occt("STEPControl").STEPControl_Reader()
        if reader.ReadStream(Path(path).name, io.BytesIO(data)) != _done():
            raise refusal(path, "OCCT cannot make out its content; the STEP file is damaged, export or copy it again")
        check_entities(path, reader.StepModel())
        yield reader, faces


def _file_unit(reader) -> float:
    """The length unit of the file's first representation in millimetres; 1 for a file without any."""
    model = reader.StepModel()
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if hasattr(entity, "GlobalUnitAssignedContext"):
            units = occt("STEPConstruct").STEPConstruct_UnitContext()
            units.ComputeFactors(entity.GlobalUnitAssignedContext())
            if units.LengthDone():
                return units.LengthFactor()
    return 1.0


def _text(model, name: str) -> bytes:
    """The file's content; every number in the shortest form that reads back bit for bit."""
    string = occt("TCollection").TCollection_HAsciiString
    title = string(_escaped(name))
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, occt("StepBasic").StepBasic_Product):
            entity.SetName(title)
            entity.SetId(title)
    header = occt("APIHeaderSection").APIHeaderSection_MakeHeader(model)
    header.SetName(title)
    header.SetAuthorValue(1, string(""))
    header.SetOrganizationValue(1, string(""))
    header.SetOriginatingSystem(string("jaxsurf"))
    header.SetAuthorisation(string(""))
    writer = occt("StepData").StepData_StepWriter(model)
    # OCCT's own format stops after 14 digits.
    writer.FloatWriter().SetFormat("%.16E")
    writer.SendModel(model.Protocol())
    stream = io.BytesIO()
    writer.Print(stream)
    return re.sub(rb"-?\d\.\d{16}E[+-]\d+", _shortest, stream.getvalue())


def _shortest(number: re.Match) -> bytes:
    mantissa, _, exponent = repr(float(number[0])).partition("e")
    mantissa = mantissa.removesuffix("0") if mantissa.endswith(".0") else mantissa
    if not exponent:
        return mantissa.encode()
    return f"{mantissa}{'' if '.' in mantissa else '.'}E{exponent}".encode()


def _escaped(text: str) -> str:
    """Characters outside ASCII in the way of ISO 10303-21."""
    basic = max(map(ord, text), default=0) < 0x10000
    start, encoding = ("\\X2\\", "utf-16-be") if basic else ("\\X4\\", "utf-32-be")
    return re.sub(r"[^\x20-\x7e]+", lambda run: start + run[0].encode(encoding).hex().upper() + "\\X0\\", text)


@functools.cache
def _done():
    return occt("IFSelect").IFSelect_ReturnStatus.IFSelect_RetDone
