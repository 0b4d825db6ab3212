"""`tangent_to` and `tangency_report`: planes checked, an operator chosen, and what came of it."""

import warnings
from typing import Any

import numpy as np
from jaxtyping import Float

from .._arguments import as_type, early
from .._array import eps, is_concrete
from .._errors import GeometryWarning, InputError
from ..surface import AbstractSurface
from ._curved_surface import OPERATORS as SECOND_ORDER, CurvedSurface
from ._edge_fields import given_fields, with_curvature
from ._network import Network
from ._network_reports import NetworkReport, network_report
from ._ribbons import CORNERS, SIDES
from ._tangency_facts import (
    Corner,
    LineFacts,
    SideFacts,
    curved_ends,
    curved_outcome,
    is_a_point,
    line_facts,
    outcome,
    predicted,
    side_facts,
)
from ._tangency_reports import (
    CornerReport,
    CurvatureReport,
    CurvedCornerReport,
    CurvedSideReport,
    SideReport,
    TangencyReport,
)
from ._tangent_surface import OPERATORS, TangentSurface

_LIFT = 0.01728  # the largest value of the quintic with second derivative 1 at an end
_CORNER = 1e-9  # relative size of ⟨S_v, M_j'⟩ − ⟨S_u, M_i'⟩ up to which corners count as compatible


def tangent_to(
    surface: AbstractSurface,
    *,
    u0: Any = None,
    u1: Any = None,
    v0: Any = None,
    v1: Any = None,
    operator: str = "auto",
    order: int = 1,
    curvature: dict[str, Any] | None = None,
    tolerance: float = 1e-6,
) -> TangentSurface | CurvedSurface:
    """Bend a surface so that it touches given planes along sides and keeps all four boundary curves.

    u0, u1, v0, v1: normals of the planes along the sides u = first, u = last, v = first, v = last, of any length: a function
    of the parameter along the side, (3,) each; an array (n, 3) at even steps of it; a curve of normals;
    (surface, side) of a neighbour whose side is the same curve at equal shares of it, either way round, for its tangent
    planes; None leaves a side free.
    The planes hold the tangents of their side, (4.3), and at its ends the tangents of the sides that it meets, (4.4), within
    `tolerance` radians; between the points of an array they are turned until they do.
    operator: "scaling" (F of the paper, which scales lines across as a whole), "hermite" (H, always defined), "gregory" (H
    without conditions at corners), "blend" (F where its lines behave, H elsewhere), or "auto": F if every line behaves,
    else H, and Gregory H where corners are not compatible (5.7) to (5.10); inside `jit` it is Gregory H.
    order: 2 for the normal curvature across the sides too, G2, by H with quintic weights ("hermite" or "gregory"). It is
    that of a neighbour given as (surface, side), or `curvature[side]`: a number, numbers (n,) at even steps of the side, or
    a function of the parameter; positive where the side bends towards the given normal. Where the boundary curve that meets
    a side at its end has not the normal curvature asked for there, it is moved, and a warning says by how much.
    Raises `InputError` where a plane does not hold its curves, and for F where (4.14) fails. Source: Jōnishi, Yajima (paper
    000), sections 4 and 5.
    """
    given = {"u0": u0, "u1": u1, "v0": v0, "v1": v1}
    _check_order(order, curvature)
    if order == 2:
        return _curved(surface, given, operator, curvature or {}, tolerance)[0]
    return _bent(surface, given, operator, tolerance)[0]


def tangency_report(
    surface: AbstractSurface | Network,
    *,
    u0: Any = None,
    u1: Any = None,
    v0: Any = None,
    v1: Any = None,
    operator: str = "auto",
    order: int = 1,
    curvature: dict[str, Any] | None = None,
    tolerance: float = 1e-6,
) -> TangencyReport | CurvatureReport | NetworkReport:
    """What `tangent_to` with the same arguments does to a surface, and what it finds on its sides and corners.

    Of a smooth network, given alone: what `Network.smooth` did to each patch, where F would have been fit, and at which
    nodes twists have no common solution.
    """
    given = {"u0": u0, "u1": u1, "v0": v0, "v1": v1}
    if isinstance(surface, Network):
        if any(field is not None for field in given.values()):
            raise InputError("`surface` is a network, whose planes are its own; leave out `u0`, `u1`, `v0` and `v1`.")
        return network_report(surface, tolerance)
    _check_order(order, curvature)
    if order == 2:
        return _curvature_report(*_curved(surface, given, operator, curvature or {}, tolerance))
    bent, sides, corners = _bent(surface, given, operator, tolerance)
    if not is_concrete(bent):
        raise InputError("`surface` of a report must be known, got one inside `jit` or `grad`; call it outside.")
    done, lines = outcome(bent), line_facts(bent)
    foretold = predicted(bent, sides, corners)
    reports = []
    for name, facts in sides.items():
        axis, end = divmod(SIDES.index(name), 2)
        line = lines[axis]
        below = np.abs(np.asarray(line.below[:, end]))
        places = _places(surface, axis, len(below))
        k = np.asarray(line.k[:, end])
        left = float(np.max(foretold[name])) if bent.operator == "hermite" else 0.0
        reports.append(
            SideReport(
                name,
                float(np.max(_off_side(facts))),
                _two(_off_ends(facts)),
                float(np.min(np.abs(_facing(facts)))),
                float(np.min(np.abs(np.asarray(line.chord_slope[:, end])))),
                float(below.min()),
                float(places[np.argmin(below)]),
                (float(k.min()), float(k.max())),
                _two(line.slopes_of_k[:, end]),
                float(np.max(done.before[name])),
                float(np.max(done.after[name])),
                left,
            )
        )
    behaves = float(np.mean([np.mean(np.asarray(line.behave)) for line in lines.values()]))
    found = tuple(_corner_report(at, corner) for at, corner in corners.items())
    return TangencyReport(bent.operator, _compatible(corners, tolerance), behaves, float(done.moved), tuple(reports), found)


def _check_order(order: int, curvature: dict[str, Any] | None) -> None:
    if order not in (1, 2):
        raise InputError(f"`order` must be 1 for tangent planes or 2 for curvature too, got {order!r}.")
    if order == 1 and curvature is not None:
        raise InputError("`curvature` counts with `order=2` alone; give that too, or leave it out.")


def _curvature_report(bent: CurvedSurface, ends: Any) -> CurvatureReport:
    if ends is None:
        raise InputError("`surface` of a report must be known, got one inside `jit` or `grad`; call it outside.")
    done, (first, left) = curved_outcome(bent), (np.asarray(x) for x in ends)
    most = lambda values: float(np.max(np.asarray(values)))
    sides = []
    for name in done.before:
        axis, end = divmod(SIDES.index(name), 2)
        numbers = [most(row[name]) for row in (done.before, done.after, done.bend_before, done.bend_after)]
        before, after, bend_before, bend_after = numbers
        largest, boundary = most(np.abs(done.wanted[name])), _LIFT * most(first[axis, :, 2 + end])
        sides.append(CurvedSideReport(name, before, after, largest, bend_before, bend_after, boundary))
    corners = [
        CurvedCornerReport(
            (f"u{i}", f"v{j}"),
            float(left[1, i, j]),
            (float(left[1, i, 2 + j]), float(left[2, i, j])),
            float(left[2, i, 2 + j]),
        )
        for i, j in CORNERS
        if bent.fields[i] is not None and bent.fields[2 + j] is not None
    ]
    compatible = bool(left[1:].max() <= _CORNER * max(1.0, max(side.curvature for side in sides)))
    return CurvatureReport(bent.operator, compatible, float(done.moved), tuple(sides), tuple(corners))


def _curved(
    surface: AbstractSurface, given: dict[str, Any], operator: str, curvature: dict[str, Any], tolerance: float
) -> tuple[CurvedSurface, Any]:
    """The surface bent to second order, and what is known at the ends of its sides, if anything is."""
    if operator not in ("auto", *SECOND_ORDER):
        raise InputError(f"`operator` of order 2 must be auto, hermite or gregory, got {operator!r}.")
    unknown = [side for side in curvature if side not in SIDES or given[side] is None]
    if unknown:
        raise InputError(f"`curvature` must be of sides with normals, among u0, u1, v0, v1, got {unknown[0]!r}.")
    flat, known, _ = _bent(surface, given, "gregory", tolerance)
    fields = list(flat.fields)
    for k, (side, field) in enumerate(zip(SIDES, fields, strict=True)):
        if field is not None and side in curvature:
            fields[k] = field = as_type(with_curvature(field, curvature[side], surface, side), surface.dtype)
        if field is not None and not field.curved:
            raise InputError(
                f"`{side}` needs curvatures across it for `order=2`: give `curvature={{'{side}': values}}`, or "
                "(surface, side) of a neighbour."
            )
    both = all(flat.bent(axis) for axis in (0, 1))
    kind = operator if operator != "auto" else "gregory" if both else "hermite"
    bent = CurvedSurface(surface, tuple(fields), kind)
    if not is_concrete(bent):
        return bent, None
    ends = early(curved_ends, bent)
    moved = _LIFT * float(np.max(np.asarray(ends[0])[..., 2:]))
    size = float(np.max(np.ptp(np.concatenate([facts.point for facts in known.values()]), axis=0)))
    if moved > max(tolerance, 1e3 * eps(surface.dtype)) * size:
        warnings.warn(
            f"Boundary curves have not the normal curvature that is asked for where they meet a side: they move by up to "
            f"{moved:.2g}; take `order=1`, or curvatures that fit them.",
            GeometryWarning,
            stacklevel=3,
        )
    return bent, ends


def _bent(
    surface: AbstractSurface, given: dict[str, Any], operator: str, tolerance: float
) -> tuple[TangentSurface, dict[str, SideFacts], dict[tuple[int, int], Corner]]:
    if operator not in ("auto", *OPERATORS):
        raise InputError(f"`operator` must be one of auto, {', '.join(OPERATORS)}, got {operator!r}.")
    fields = given_fields(surface, given)
    bent = TangentSurface(surface, fields, "gregory" if operator == "auto" else operator)
    if not is_concrete(bent):
        return bent, {}, {}
    sides, corners = early(side_facts, bent)
    allowed = max(tolerance, 1e3 * eps(surface.dtype))
    sampled = {side for side in SIDES if _is_array(given[side])}
    for name, facts in sides.items():
        _check_side(name, facts, surface, allowed, sampled, operator)
    compatible = _compatible(corners, allowed)
    # of the surface and its planes alone: one program whatever the operator
    lines = early(line_facts, bent) if operator == "scaling" or (operator == "auto" and compatible) else {}
    if operator == "auto":
        operator = "gregory" if not compatible else "scaling" if _fit_for_scaling(lines) else "hermite"
    elif not compatible and operator != "gregory":
        angle = max(float(np.max(x)) for x in early(predicted, bent, sides, corners).values())
        warnings.warn(
            f"Corners are not compatible, (5.7) to (5.10): {operator!r} leaves up to {angle:.2g} rad to the planes; "
            '"gregory" needs no such condition.',
            GeometryWarning,
            stacklevel=3,
        )
    bent = TangentSurface(surface, fields, operator)
    if operator == "scaling":
        _check_scaling(bent, lines)
    return bent, sides, corners


def _places(surface: AbstractSurface, axis: int, count: int) -> Float[np.ndarray, "n"]:
    """Even parameters along the sides across an axis."""
    first, last = (float(x) for x in surface.domain[1 - axis])
    return np.linspace(first, last, count)


def _two(values: Any) -> tuple[float, float]:
    first, second = (float(x) for x in values)
    return first, second


def _is_array(given: Any) -> bool:
    return (
        given is not None
        and not callable(given)
        and not (isinstance(given, tuple) and isinstance(given[0], AbstractSurface))
    )


def _off_side(facts: SideFacts) -> Float[np.ndarray, "n"]:
    """Angles between the planes and the tangents of their side."""
    return _lift(facts.along, facts.given)


def _off_ends(facts: SideFacts) -> Float[np.ndarray, "2"]:
    """Angles between the planes and the derivatives across, at both ends."""
    return _lift(facts.across, facts.given)[[0, -1]]


def _facing(facts: SideFacts) -> Float[np.ndarray, "n"]:
    return np.sum(np.asarray(facts.own) * np.asarray(facts.given), axis=1)


def _lift(vectors: Any, normals: Any) -> Float[np.ndarray, "n"]:
    vectors = np.asarray(vectors)
    lengths = np.sqrt(np.sum(vectors**2, axis=1))
    small = lengths <= 1e-9 * lengths.max()
    return np.where(small, 0, np.abs(np.sum(vectors * np.asarray(normals), axis=1)) / np.where(small, 1, lengths))


def _check_side(
    name: str, facts: SideFacts, surface: AbstractSurface, allowed: float, sampled: set[str], operator: str
) -> None:
    axis = SIDES.index(name) // 2
    letter, places = "vu"[axis], _places(surface, axis, len(facts.point))
    lengths = np.sqrt(np.sum(np.asarray(facts.given) ** 2, axis=1))
    if not np.all(np.isfinite(lengths)) or lengths.min() < 0.5:
        worst = places[np.argmin(np.nan_to_num(lengths))]
        raise InputError(
            f"`{name}` must give finite normals of length > 0 all along the side, got none at {letter} = {worst:.6g}."
        )
    if operator in ("scaling", "blend") and bool(is_a_point(facts, surface)):
        raise InputError(
            f'`{name}` is a side that is a single point, on which {operator!r} is not defined; take `operator="hermite"`.'
        )
    off = _off_side(facts)
    ends = off[[0, -1]] if name in sampled else off
    at = places[[0, -1]] if name in sampled else places
    if ends.max() > allowed:
        raise InputError(
            f"`{name}` must be normal to the side's curve within {allowed:.2g} rad, (4.3), and is off by "
            f"{ends.max():.3g} rad at {letter} = {at[np.argmax(ends)]:.6g}; take away "
            "the part of each normal that lies along the curve."
        )
    off = _off_ends(facts)
    if off.max() > allowed:
        end = int(np.argmax(off))
        raise InputError(
            f"`{name}` must at its ends be normal to the surface, since the boundary curves that meet there are kept, "
            f"(4.4): it is off by {off[end]:.3g} rad at {letter} = {places[-end]:.6g}; give the surface's own normal there."
        )
    cosines = _facing(facts)
    if cosines.min() < 0 < cosines.max() and min(-cosines.min(), cosines.max()) > 1e-6:
        worst = places[np.argmin(np.abs(cosines))]
        raise InputError(
            f"`{name}` must keep to one side of the surface, (4.5), and is at right angles to its normal near {letter} = "
            f"{worst:.6g}: the surface would fold; give normals within 90° of the surface's own."
        )


def _corner_report(at: tuple[int, int], corner: Corner) -> CornerReport:
    normals, (rho, other) = np.asarray(corner.normals), corner.rho
    off = float(np.arctan2(np.sqrt(np.sum(np.cross(normals[0], normals[1]) ** 2)), normals[0] @ normals[1]))
    twist = float(other - rho)
    sizes = [float(np.sqrt(np.sum(np.asarray(x) ** 2))) for x in (corner.first, corner.changes)]
    sides = (f"u{at[0]}", f"v{at[1]}")
    return CornerReport(sides, off, twist, abs(twist) / max(sizes[0] * max(sizes[1], 1), np.finfo(float).tiny))


def _compatible(corners: dict[tuple[int, int], Corner], allowed: float) -> bool:
    reports = [_corner_report(at, corner) for at, corner in corners.items()]
    return all(r.relative <= max(_CORNER, 1e-3 * allowed) and r.off <= allowed for r in reports)


def _fit_for_scaling(lines: dict[int, LineFacts]) -> bool:
    return all(bool(np.all(np.asarray(line.behave))) for line in lines.values())


def _check_scaling(bent: TangentSurface, lines: dict[int, LineFacts]) -> None:
    """F is refused where its denominator vanishes on a line, or between two lines."""
    for axis, line in lines.items():
        for end in (0, 1):
            if bent.fields[2 * axis + end] is None:
                continue
            below = np.asarray(line.below[:, end])
            places = _places(bent, axis, len(below))
            pulled = np.asarray(line.pulled[:, end]) > 1e-9
            turns = np.flatnonzero((below[:-1] * below[1:] < 0) & (pulled[:-1] | pulled[1:]))
            small = np.flatnonzero(np.asarray(line.singular[:, end]))
            if len(turns) or len(small):
                worst = places[small[0]] if len(small) else places[turns[0]]
                raise InputError(
                    f'`{SIDES[2 * axis + end]}` cannot be met by "scaling": the left side of (4.14) vanishes near '
                    f'{"vu"[axis]} = {worst:.6g}, as on ruled surfaces; take `operator="hermite"` or "auto".'
                )
