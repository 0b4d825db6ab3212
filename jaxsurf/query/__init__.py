from ._closest import (
    Foot as Foot,
    closest_point as closest_point,
    feet_with_derivatives as feet_with_derivatives,
    foot_at as foot_at,
    refine_feet as refine_feet,
)
from ._newton import held_parameters as held_parameters, value_and_tangents as value_and_tangents
from ._starts import nearest_samples as nearest_samples
