from ._mapped import MappedCurve as MappedCurve
from ._mapped import MappedSurface as MappedSurface
from ._parameters import (
    reparametrise as reparametrise,
)
from ._parameters import (
    reverse as reverse,
)
from ._parameters import (
    split as split,
)
from ._parameters import (
    transpose as transpose,
)
from ._refine import (
    clamp as clamp,
)
from ._refine import (
    elevate_degree as elevate_degree,
)
from ._refine import (
    insert_knots as insert_knots,
)
from ._refine import (
    remove_knots as remove_knots,
)
from ._refine import (
    unrolled as unrolled,
)
from ._reparametrised import (
    ReparametrisedCurve as ReparametrisedCurve,
)
from ._reparametrised import (
    ReparametrisedSurface as ReparametrisedSurface,
)
from ._transform import (
    mirror as mirror,
)
from ._transform import (
    rotate as rotate,
)
from ._transform import (
    scale as scale,
)
from ._transform import (
    transform as transform,
)
from ._transform import (
    translate as translate,
)
