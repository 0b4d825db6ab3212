from ._blend import (
    AbstractBlend as AbstractBlend,
    Smoothstep as Smoothstep,
    linear as linear,
    smoothstep as smoothstep,
)
from ._make_sweep import sweep as sweep
from ._orientations import OrientationRotation as OrientationRotation
from ._rotation import AbstractRotation as AbstractRotation, UpRotation as UpRotation
from ._rotation_minimising import RotationMinimising as RotationMinimising
from ._sweep import Sweep as Sweep
