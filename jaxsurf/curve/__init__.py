from ._abstract import AbstractCurve as AbstractCurve
from ._breaks import breaks as breaks
from ._bspline import BSplineCurve as BSplineCurve, combine as combine
from ._composite import CompositeCurve as CompositeCurve
from ._elementary import Arc as Arc, Circle as Circle, Helix as Helix, Line as Line
from ._nurbs import NURBSCurve as NURBSCurve, homogeneous as homogeneous, project as project
from ._quaternion_integral import QICurve as QICurve
