"""Where a shape is sampled to find starting values: a few parameters in every knot span."""

from functools import singledispatch
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..basis import BSplineBasis
from ..curve import AbstractCurve, BSplineCurve, Circle, NURBSCurve, QICurve
from ..curve._quaternion_integral import PreparedQICurve
from ..surface import (
    AbstractSurface,
    BSplineSurface,
    Cone,
    Cylinder,
    NURBSSurface,
    QISurface,
    Sphere,
    Torus,
    TrimmedSurface,
)
from ..surface._quaternion_integral import PreparedQISurface, TranslatedSpine

_DEFAULT_COUNT = 49


@singledispatch
def sample_parameters(shape: Any) -> tuple[Float[Array, "_"], ...]:
    """Ascending parameters in each direction that resolve the shape, both ends included; works on traced shapes."""
    raise TypeError(f"`sample_parameters` expects a curve or a surface, got {type(shape).__name__}.")


@sample_parameters.register
def _(shape: AbstractCurve) -> tuple[Float[Array, "_"], ...]:
    return (_evenly(shape.domain, shape.dtype),)


@sample_parameters.register
def _(shape: AbstractSurface) -> tuple[Float[Array, "_"], ...]:
    domain_u, domain_v = shape.domain
    return _evenly(domain_u, shape.dtype), _evenly(domain_v, shape.dtype)


@sample_parameters.register(BSplineCurve)
@sample_parameters.register(NURBSCurve)
def _(shape: Any) -> tuple[Float[Array, "_"], ...]:
    return (_in_spans(shape.basis, 6, 24),)


@sample_parameters.register(BSplineSurface)
@sample_parameters.register(NURBSSurface)
def _(shape: Any) -> tuple[Float[Array, "_"], ...]:
    return _in_spans(shape.basis_u, 4, 12), _in_spans(shape.basis_v, 4, 12)


@sample_parameters.register
def _(shape: QICurve) -> tuple[Float[Array, "_"], ...]:
    return (_in_spans(shape.basis, 6, 24),)


@sample_parameters.register
def _(shape: QISurface) -> tuple[Float[Array, "_"], ...]:
    return _in_spans(shape.basis_u, 4, 12), _in_spans(shape.basis_v, 4, 12)


@sample_parameters.register
def _(shape: PreparedQICurve) -> tuple[Float[Array, "_"], ...]:
    return sample_parameters(shape.curve)


@sample_parameters.register(PreparedQISurface)
@sample_parameters.register(TranslatedSpine)
def _(shape: Any) -> tuple[Float[Array, "_"], ...]:
    return sample_parameters(shape.surface)


@sample_parameters.register
def _(shape: TrimmedSurface) -> tuple[Float[Array, "_"], ...]:
    return sample_parameters(shape.surface)


@singledispatch
def periodic_directions(shape: Any) -> tuple[bool, ...]:
    """For each parameter, whether the shape goes on smoothly across the ends of its domain."""
    return (False,) if isinstance(shape, AbstractCurve) else (False, False)


@periodic_directions.register
def _(shape: Circle) -> tuple[bool, ...]:
    return (True,)


@periodic_directions.register(Sphere)
@periodic_directions.register(Cylinder)
@periodic_directions.register(Cone)
def _(shape: Any) -> tuple[bool, ...]:
    return True, False


@periodic_directions.register
def _(shape: Torus) -> tuple[bool, ...]:
    return True, True


@periodic_directions.register
def _(shape: TrimmedSurface) -> tuple[bool, ...]:
    return periodic_directions(shape.surface)


@periodic_directions.register
def _(shape: BSplineCurve) -> tuple[bool, ...]:
    return (shape.periodic,)


@periodic_directions.register
def _(shape: BSplineSurface) -> tuple[bool, ...]:
    return shape.periodic_u, shape.periodic_v


def domain_box(shape: AbstractCurve | AbstractSurface) -> tuple[Float[Array, "k"], Float[Array, "k"]]:
    """Lower and upper ends of the parameters as vectors."""
    ends = [shape.domain] if isinstance(shape, AbstractCurve) else list(shape.domain)
    lower, upper = zip(*ends, strict=True)
    return jnp.stack([jnp.asarray(x, shape.dtype) for x in lower]), jnp.stack([jnp.asarray(x, shape.dtype) for x in upper])


def _evenly(domain: tuple[Any, Any], dtype: Any) -> Float[Array, "m"]:
    a, b = (jnp.asarray(end, dtype) for end in domain)
    return a + (b - a) * jnp.linspace(0, 1, _DEFAULT_COUNT, dtype=dtype)


def _in_spans(basis: BSplineBasis, per_span: int, least: int) -> Float[Array, "m"]:
    """`per_span` parameters in each span, or `degree` if that is more; at least `least` intervals in all."""
    knots = basis.knots if basis.periodic else basis.knots[basis.degree : basis.size + 1]
    per_span = max(per_span, basis.degree, -(-least // (knots.shape[0] - 1)))
    share = jnp.arange(per_span, dtype=knots.dtype) / per_span
    inside = knots[:-1, None] + (knots[1:] - knots[:-1])[:, None] * share[None, :]
    return jnp.concatenate([inside.reshape(-1), knots[-1:]])
