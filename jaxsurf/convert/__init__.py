from ._bspline import Conversion as Conversion, to_bspline as to_bspline
from ._interpolate import interpolate as interpolate
