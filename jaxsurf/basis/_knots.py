"""Knot vectors: making and checking them."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._array import concrete, is_concrete
from .._errors import InputError


def clamped_knots(n: int, degree: int, domain: tuple[float, float] = (0.0, 1.0)) -> Float[Array, "k"]:
    """Knots for `n` control points, evenly spaced inside, the ends repeated `degree + 1` times; shape (n + degree + 1,).

    A curve on these knots starts at its first control point and ends at its last.
    """
    _check_count(n, degree)
    a, b = _check_domain(domain)
    inner = jnp.linspace(a, b, n - degree + 1)
    return jnp.concatenate([jnp.full(degree, inner[0]), inner, jnp.full(degree, inner[-1])])


def uniform_knots(n: int, degree: int, domain: tuple[float, float] = (0.0, 1.0)) -> Float[Array, "k"]:
    """Evenly spaced knots for `n` control points, none repeated; shape (n + degree + 1,).

    `domain` is where the curve lives, that is knots[degree] to knots[n]; `degree` more knots lie beyond each end.
    """
    _check_count(n, degree)
    a, b = _check_domain(domain)
    share = jnp.asarray(np.arange(-degree, n + 1) / (n - degree))
    return (1 - share) * a + share * b  # exactly the domain's ends at shares 0 and 1


def periodic_knots(n: int, degree: int, domain: tuple[float, float] = (0.0, 1.0)) -> Float[Array, "k"]:
    """Evenly spaced knots for a closed curve of `n` control points; shape (n + 1,), the period is the domain's length."""
    if n < 1 or degree < 1:
        raise InputError(f"`n` and `degree` must be at least 1, got n={n} and degree={degree}.")
    a, b = _check_domain(domain)
    return jnp.linspace(a, b, n + 1)


def check_knots(knots: Float[Array, "..."], degree: int, count: int, *, periodic: bool = False, name: str = "knots") -> None:
    """Refuse knot vectors that define no B-spline of `degree` on `count` control points.

    Shapes are checked always, values only on concrete data: finite, ascending, inner knots repeated at most `degree`
    times, end knots at most `degree + 1` times. `name` is the argument that the message names.
    """
    if degree < 1:
        raise InputError(f"The degree that goes with `{name}` must be at least 1, got {degree}.")
    needed = count + 1 if periodic else count + degree + 1
    if knots.ndim != 1 or knots.shape[0] != needed:
        kind = "periodic, n + 1" if periodic else "n + degree + 1"
        raise InputError(
            f"`{name}` must have {needed} knots ({kind}) for n={count} control points of degree {degree}, "
            f"got shape {knots.shape}."
        )
    if not periodic and count < degree + 1:
        raise InputError(f"`{name}` of degree {degree} needs at least {degree + 1} control points, got {count}.")
    if not is_concrete(knots):
        return
    values = concrete(knots)
    if not np.all(np.isfinite(values)):
        raise InputError(
            f"`{name}` must be finite, got {values[~np.isfinite(values)][0]} at index {int(np.argmin(np.isfinite(values)))}."
        )
    falls = np.flatnonzero(np.diff(values) < 0)
    if falls.size:
        i = int(falls[0])
        raise InputError(
            f"`{name}` must ascend, but knot {i + 1} ({values[i + 1]:g}) is below knot {i} ({values[i]:g}); sort them."
        )
    a, b = (values[0], values[-1]) if periodic else (values[degree], values[count])
    if not a < b:
        raise InputError(f"`{name}` must span a domain of positive length, got [{a:g}, {b:g}].")
    distinct, multiplicity = np.unique(values, return_counts=True)
    inner = (distinct > a) & (distinct < b)
    for where, most, what in ((inner, degree, "inner"), (~inner, 1 if periodic else degree + 1, "end")):
        bad = where & (multiplicity > most)
        if np.any(bad):
            i = int(np.argmax(bad))
            raise InputError(
                f"`{name}` repeats the {what} knot {distinct[i]:g} {multiplicity[i]} times; degree {degree} allows {most}: "
                f"remove {multiplicity[i] - most} of them (and as many control points)."
            )


def extend_periodic(knots: Float[Array, "k"], degree: int) -> Float[Array, "k2"]:
    """The knots of one period, continued by `degree` knots on both sides (over several periods if need be)."""
    period = knots[-1] - knots[0]
    count = knots.shape[0] - 1
    index = np.arange(-degree, count + degree + 1)
    return knots[index % count] + period * jnp.asarray(index // count, knots.dtype)


def greville(knots: Float[Array, "k"], degree: int) -> Float[Array, "n"]:
    """Greville abscissae: means of `degree` neighbouring knots, one per control point (Farin, §8.7)."""
    count = knots.shape[0] - degree - 1
    return jnp.mean(jnp.stack([knots[1 + i : 1 + i + count] for i in range(degree)]), axis=0)


def _check_count(n: int, degree: int) -> None:
    if degree < 1:
        raise InputError(f"`degree` must be at least 1, got {degree}.")
    if n < degree + 1:
        raise InputError(f"`n` must be at least degree + 1 = {degree + 1}, got {n}.")


def _check_domain(domain: tuple[float, float]) -> tuple[float, float]:
    a, b = domain
    if is_concrete(a, b) and not (np.isfinite(a) and np.isfinite(b) and a < b):
        raise InputError(f"`domain` must be two finite ascending numbers, got {domain}.")
    return a, b
