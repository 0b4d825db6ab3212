from ._abstract import AbstractSurface as AbstractSurface
from ._breaks import breaks as breaks
from ._bspline import BSplineSurface as BSplineSurface
from ._elementary import (
    Cone as Cone,
)
from ._elementary import (
    Cylinder as Cylinder,
)
from ._elementary import (
    Plane as Plane,
)
from ._elementary import (
    Sphere as Sphere,
)
from ._elementary import (
    Torus as Torus,
)
from ._nurbs import NURBSSurface as NURBSSurface
from ._trimmed import TrimmedSurface as TrimmedSurface
