from . import quaternion as quaternion
from ._errors import GeometryWarning as GeometryWarning, InputError as InputError, MissingPackageError as MissingPackageError
from ._lazy import __dir__ as __dir__, __getattr__ as __getattr__
from ._progress import Event as Event, silent as silent
from ._registry import register as register
from .basis import (
    BSplineBasis as BSplineBasis,
    clamped_knots as clamped_knots,
    periodic_knots as periodic_knots,
    uniform_knots as uniform_knots,
)
from .build import (
    Coons as Coons,
    ExtendedCoons as ExtendedCoons,
    Extrusion as Extrusion,
    Loft as Loft,
    OrientationRotation as OrientationRotation,
    Revolution as Revolution,
    RotationMinimising as RotationMinimising,
    Smoothstep as Smoothstep,
    Sweep as Sweep,
    UpRotation as UpRotation,
    coons as coons,
    extended_coons as extended_coons,
    extrude as extrude,
    linear as linear,
    loft as loft,
    revolve as revolve,
    smoothstep as smoothstep,
    sweep as sweep,
)
from .convert import (
    Conversion as Conversion,
    insert_tangent as insert_tangent,
    interpolate as interpolate,
    interpolate_qi as interpolate_qi,
    to_bspline as to_bspline,
    to_qi as to_qi,
)
from .curve import (
    AbstractCurve as AbstractCurve,
    Arc as Arc,
    BSplineCurve as BSplineCurve,
    Circle as Circle,
    CompositeCurve as CompositeCurve,
    Helix as Helix,
    Line as Line,
    NURBSCurve as NURBSCurve,
    QICurve as QICurve,
)
from .differential import (
    ByArcLength as ByArcLength,
    Curvature as Curvature,
    arc_length as arc_length,
    area as area,
    curvature as curvature,
    curve_curvature as curve_curvature,
    derivative as derivative,
    equally_spaced as equally_spaced,
    first_form as first_form,
    frenet_frame as frenet_frame,
    normal as normal,
    parameter_at_length as parameter_at_length,
    partials as partials,
    second_form as second_form,
    second_partials as second_partials,
    torsion as torsion,
    volume as volume,
)
from .edit import (
    clamp as clamp,
    elevate_degree as elevate_degree,
    insert_knots as insert_knots,
    mirror as mirror,
    remove_knots as remove_knots,
    reparametrise as reparametrise,
    reverse as reverse,
    rotate as rotate,
    scale as scale,
    split as split,
    transform as transform,
    translate as translate,
    transpose as transpose,
    unrolled as unrolled,
)
from .fit import (
    CloudFit as CloudFit,
    Deviation as Deviation,
    Fit as Fit,
    fit as fit,
    fit_cloud as fit_cloud,
    fit_qi as fit_qi,
    parametrise as parametrise,
    qi_plane as qi_plane,
    trim_to_cloud as trim_to_cloud,
)
from .query import Foot as Foot, closest_point as closest_point
from .surface import (
    AbstractSurface as AbstractSurface,
    BSplineSurface as BSplineSurface,
    Cone as Cone,
    Cylinder as Cylinder,
    NURBSSurface as NURBSSurface,
    Plane as Plane,
    QISurface as QISurface,
    Sphere as Sphere,
    Torus as Torus,
    TrimmedSurface as TrimmedSurface,
    closure_density as closure_density,
    closure_gap as closure_gap,
)
