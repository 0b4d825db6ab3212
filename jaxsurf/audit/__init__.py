from ._continuity import (
    ANGLE as ANGLE,
    CURVATURE as CURVATURE,
    GAP as GAP,
    Continuity as Continuity,
    continuity as continuity,
)
from ._model import SharedEdge as SharedEdge, shared_edges as shared_edges
