from ._arc_length import equally_spaced as equally_spaced, parameter_at_length as parameter_at_length
from ._by_length import ByArcLength as ByArcLength
from ._curvature import Curvature as Curvature, curvature as curvature, curvature_at as curvature_at
from ._curves import (
    FrenetFrame as FrenetFrame,
    curve_curvature as curve_curvature,
    frenet_frame as frenet_frame,
    torsion as torsion,
)
from ._forms import FundamentalForm as FundamentalForm, first_form as first_form, second_form as second_form
from ._jets import basis_derivatives as basis_derivatives, jet as jet
from ._measure import arc_length as arc_length, area as area, volume as volume
from ._normal import normal as normal, normal_at as normal_at
from ._partials import (
    Partials as Partials,
    Partials2 as Partials2,
    derivative as derivative,
    partials as partials,
    partials_at as partials_at,
    second_partials as second_partials,
    second_partials_at as second_partials_at,
)
