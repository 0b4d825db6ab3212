from ._abstract import AbstractCurve as AbstractCurve
from ._bspline import BSplineCurve as BSplineCurve
