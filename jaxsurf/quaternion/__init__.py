from ._algebra import (
    conjugate as conjugate,
    inverse as inverse,
    multiply as multiply,
    norm as norm,
    normalize as normalize,
    rotate as rotate,
)
from ._directions import (
    angular_velocity as angular_velocity,
    blended_direction as blended_direction,
    blended_on_spans as blended_on_spans,
    turned as turned,
)
from ._exponential import exp as exp, log as log
from ._rotation import (
    from_matrix as from_matrix,
    half_rotation as half_rotation,
    minimal_rotation as minimal_rotation,
    slerp as slerp,
    to_matrix as to_matrix,
    turn as turn,
)
from ._spline import QuaternionSpline as QuaternionSpline
