from . import _quaternion_integral as _quaternion_integral  # its rules
from ._mapped import MappedCurve as MappedCurve, MappedSurface as MappedSurface
from ._parameters import (
    reparametrise as reparametrise,
    reverse as reverse,
    split as split,
    transpose as transpose,
)
from ._refine import (
    clamp as clamp,
    elevate_degree as elevate_degree,
    insert_knots as insert_knots,
    remove_knots as remove_knots,
    unrolled as unrolled,
)
from ._reparametrised import (
    ReparametrisedCurve as ReparametrisedCurve,
    ReparametrisedSurface as ReparametrisedSurface,
)
from ._transform import (
    mirror as mirror,
    rotate as rotate,
    scale as scale,
    transform as transform,
    translate as translate,
)
