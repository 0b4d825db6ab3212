from ._align import Alignment as Alignment, align as align
from ._choice import BestFit as BestFit, FamilyCandidate as FamilyCandidate, fit_best as fit_best
from ._cloud import CloudFit as CloudFit, Stage as Stage, fit_cloud as fit_cloud, sample_index as sample_index
from ._coverage import Coverage as Coverage, coverage as coverage
from ._deviation import Deviation as Deviation
from ._fit import fit as fit
from ._fixed import (
    FixedEdge as FixedEdge,
    FixedPoint as FixedPoint,
    PlanarEdge as PlanarEdge,
    StraightEdge as StraightEdge,
    Symmetry as Symmetry,
    TangentPlane as TangentPlane,
)
from ._found import Fit as Fit
from ._free_knots import FreeKnotCurve as FreeKnotCurve, FreeKnotSurface as FreeKnotSurface, free_knots as free_knots
from ._many import fit_many as fit_many
from ._outline import trim_to_cloud as trim_to_cloud
from ._parametrise import Parametrisation as Parametrisation, parametrise as parametrise
from ._patchwork import JoinedPatches as JoinedPatches, join_patches as join_patches
from ._pose import side_lengths as side_lengths
from ._processes import (
    any_process as any_process,
    join_processes as join_processes,
    process_count as process_count,
    process_index as process_index,
    same_error as same_error,
)
from ._quaternion_cloud import (
    fit_qi as fit_qi,
    numbers_of as numbers_of,
    peer_fit as peer_fit,
    qi_plane as qi_plane,
)
from ._ranges import JoinedRanges as JoinedRanges, Range as Range, Seam as Seam, join_ranges as join_ranges
from ._sharded_points import ShardedPoints as ShardedPoints, shard_points as shard_points
from ._sweep_cloud import (
    KINDS as KINDS,
    SweepFit as SweepFit,
    SweepKind as SweepKind,
    fit_sweep as fit_sweep,
    sweep_numbers as sweep_numbers,
)
from ._uncertainty import Uncertainty as Uncertainty
