from ._evaluate import (
    breaks_within as breaks_within,
    curve_at as curve_at,
    domain_corners as domain_corners,
    grid_at as grid_at,
    normals_at as normals_at,
    points_at as points_at,
)
from ._mesh import Mesh as Mesh
from ._polygon import inside as inside
from ._polyline import polyline as polyline
from ._tessellate import tessellate as tessellate
