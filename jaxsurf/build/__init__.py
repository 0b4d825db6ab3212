from ._blend import (
    AbstractBlend as AbstractBlend,
    Smoothstep as Smoothstep,
    linear as linear,
    smoothstep as smoothstep,
)
from ._coons import Coons as Coons, coons as coons
from ._creases import Creases as Creases, creases as creases, split_at_creases as split_at_creases
from ._curved_surface import CurvedSurface as CurvedSurface
from ._extended_coons import ExtendedCoons as ExtendedCoons, extended_coons as extended_coons
from ._extrude import Extrusion as Extrusion, extrude as extrude
from ._gordon import Gordon as Gordon, gordon as gordon
from ._join import extend as extend, join as join, segment as segment
from ._loft import Loft as Loft, loft as loft
from ._make_compatible import MendedField as MendedField, MendedFields as MendedFields, make_compatible as make_compatible
from ._make_network import network as network
from ._make_sweep import sweep as sweep
from ._network import Network as Network
from ._network_curves import NetworkEdge as NetworkEdge
from ._network_reports import NetworkReport as NetworkReport, PatchReport as PatchReport, UnsolvedNode as UnsolvedNode
from ._network_topology import NetworkTopology as NetworkTopology
from ._orientations import OrientationRotation as OrientationRotation
from ._revolve import Revolution as Revolution, revolve as revolve
from ._rotation import AbstractRotation as AbstractRotation, UpRotation as UpRotation
from ._rotation_minimising import RotationMinimising as RotationMinimising
from ._smooth_creases import smooth_creases as smooth_creases
from ._sweep import Sweep as Sweep
from ._tangent_surface import TangentSurface as TangentSurface
from ._tangent_to import (
    CornerReport as CornerReport,
    CurvatureReport as CurvatureReport,
    CurvedCornerReport as CurvedCornerReport,
    CurvedSideReport as CurvedSideReport,
    SideReport as SideReport,
    TangencyReport as TangencyReport,
    tangency_report as tangency_report,
    tangent_to as tangent_to,
)
