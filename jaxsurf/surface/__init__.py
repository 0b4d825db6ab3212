from ._abstract import AbstractSurface as AbstractSurface
from ._bspline import BSplineSurface as BSplineSurface
