from ._bspline import (
    BSplineBasis as BSplineBasis,
    Places as Places,
    local_values as local_values,
    span_polynomials as span_polynomials,
)
from ._collocate import (
    averaged_knots as averaged_knots,
    collocation_matrix as collocation_matrix,
)
from ._cumulative import cumulative_local as cumulative_local, cumulative_row as cumulative_row
from ._knots import (
    check_knots as check_knots,
    clamped_knots as clamped_knots,
    extend_periodic as extend_periodic,
    greville as greville,
    periodic_knots as periodic_knots,
    uniform_knots as uniform_knots,
)
from ._pieces import SplinePieces as SplinePieces, horner as horner, spline_pieces as spline_pieces
from ._refine import (
    elevated_knots as elevated_knots,
    elevation_matrix as elevation_matrix,
    inserted_knots as inserted_knots,
    refinement_matrix as refinement_matrix,
)
