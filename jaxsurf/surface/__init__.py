from ._abstract import AbstractSurface as AbstractSurface
from ._breaks import breaks as breaks
from ._bspline import BSplineSurface as BSplineSurface
from ._closure import closure_density as closure_density, closure_gap as closure_gap
from ._elementary import Cone as Cone, Cylinder as Cylinder, Plane as Plane, Sphere as Sphere, Torus as Torus
from ._nurbs import NURBSSurface as NURBSSurface
from ._quaternion_integral import QISurface as QISurface
from ._trimmed import TrimmedSurface as TrimmedSurface
