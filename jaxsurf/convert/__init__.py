from ._bspline import Conversion as Conversion, to_bspline as to_bspline
from ._interpolate import interpolate as interpolate
from ._interpolate_qi import interpolate_qi as interpolate_qi
from ._to_qi import insert_tangent as insert_tangent, to_qi as to_qi
