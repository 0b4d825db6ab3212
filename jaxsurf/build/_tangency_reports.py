"""What `tangency_report` finds, as data and as tables."""

from typing import NamedTuple


class SideReport(NamedTuple):
    """What `tangency_report` says of one side; angles in radians.

    off_side: largest angle between the planes and the side's tangents, (4.3); off_ends: those with the sides met at both
    ends, (4.4); facing: smallest cosine between the given and the surface's normals, (4.5); chord_slope: smallest
    |⟨e, N⟩| of (4.13); denominator: smallest left side of (4.14) for unit vectors, at `worst` (the parameter); k: smallest
    and largest factor; slopes_of_k: k' at both ends; before, after: largest angle between the surface's and the given
    planes; predicted: that which H leaves where corners are not compatible.
    """

    side: str
    off_side: float
    off_ends: tuple[float, float]
    facing: float
    chord_slope: float
    denominator: float
    worst: float
    k: tuple[float, float]
    slopes_of_k: tuple[float, float]
    before: float
    after: float
    predicted: float


class CurvedSideReport(NamedTuple):
    """What `tangency_report` with `order=2` says of one side.

    before, after: largest angle between the surface's and the given planes, radians; curvature: the largest given normal
    curvature across; bend_before, bend_after: by how much those of the surface are off at most; boundary: by how much the
    boundary curves that meet the side move, since they have not the curvature asked for there.
    """

    side: str
    before: float
    after: float
    curvature: float
    bend_before: float
    bend_after: float
    boundary: float


class CurvedCornerReport(NamedTuple):
    """A corner of two given sides: what operator "hermite" leaves to the side of u there, as derivatives along it of the
    multiples of the normal that the step along v takes away: of first, third (two of them) and fourth order in all."""

    sides: tuple[str, str]
    twist: float
    third: tuple[float, float]
    fourth: float


class CurvatureReport(NamedTuple):
    """How a surface is bent to planes and curvatures along its sides; prints as a table."""

    operator: str
    compatible: bool
    moved: float
    sides: tuple[CurvedSideReport, ...]
    corners: tuple[CurvedCornerReport, ...]

    def __str__(self) -> str:
        lines = [f"operator {self.operator} of order 2, moved by {self.moved:.3g} at most"]
        lines.append("side  angle before  after     curvature  off before  after     boundary moved")
        for s in self.sides:
            lines.append(
                f"{s.side}    {s.before:<12.2e}  {s.after:<8.1e}  {s.curvature:<9.3g}  {s.bend_before:<10.2e}  "
                f"{s.bend_after:<8.1e}  {s.boundary:.1e}"
            )
        for c in self.corners:
            lines.append(
                f"corner {c.sides[0]} {c.sides[1]}: twist off by {c.twist:.1e}, third order by {c.third[0]:.1e} and "
                f"{c.third[1]:.1e}, fourth by {c.fourth:.1e}"
            )
        return "\n".join(lines)


class CornerReport(NamedTuple):
    """A corner of two given sides, such as ("u0", "v1"): the angle between their normals there, (5.4), and the difference
    ⟨S_v, M_j'⟩ − ⟨S_u, M_i'⟩ of (5.7) to (5.10), also relative to its terms."""

    sides: tuple[str, str]
    off: float
    twist: float
    relative: float


class TangencyReport(NamedTuple):
    """How a surface is bent to planes along its sides, see `SideReport` and `CornerReport`; prints as a table.

    compatible: whether all corners hold (5.4) and (5.7) to (5.10); behaves: share of lines on which F is fit; moved: the
    largest displacement.
    """

    operator: str
    compatible: bool
    behaves: float
    moved: float
    sides: tuple[SideReport, ...]
    corners: tuple[CornerReport, ...]

    def __str__(self) -> str:
        lines = [
            f"operator {self.operator}, moved by {self.moved:.3g} at most, F fit on {100 * self.behaves:.0f} % of the lines"
        ]
        lines.append("side  (4.3)    (4.4)    (4.5)   (4.13)   (4.14)   k              before    after     predicted")
        for s in self.sides:
            lines.append(
                f"{s.side}    {s.off_side:<8.1e} {max(s.off_ends):<8.1e} {s.facing:<7.3f} {s.chord_slope:<8.1e} "
                f"{s.denominator:<8.1e} {s.k[0]:<6.3g} {s.k[1]:<7.3g} {s.before:<9.2e} {s.after:<9.2e} {s.predicted:.2e}"
            )
        for c in self.corners:
            lines.append(
                f"corner {c.sides[0]} {c.sides[1]}: normals {c.off:.1e} rad apart, twist condition off by {c.twist:.2e}"
            )
        return "\n".join(lines)
