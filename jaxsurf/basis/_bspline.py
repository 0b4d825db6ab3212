"""The B-spline basis at one parameter: span, local values, matrices."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._array import take
from .._safe import divide
from ._knots import extend_periodic

_SCAN_LIMIT = 20  # inner knots up to which comparing with all of them beats bisection


class Places(NamedTuple):
    """Where spans are: inner knots to count, and middle and scale of t = (u − middle) · scale in each span."""

    steps: Float[Array, "inner"]
    middle: Float[Array, "spans"]
    scale: Float[Array, "spans"]


class BSplineBasis(eqx.Module):
    """All basis functions of one knot vector, evaluated without 0/0 on a span that is never empty.

    knots: (n + degree + 1,), or (n + 1,) if periodic: then the functions are those of the periodically
    continued knots, and function i of the unrolled basis belongs to control point i mod n. Outside the domain
    the polynomials of the first and last span continue; periodic parameters are wrapped. Source: de Boor, A
    Practical Guide to Splines, ch. X.
    """

    knots: Float[Array, "k"]
    degree: int = eqx.field(static=True)
    periodic: bool = eqx.field(static=True, default=False)

    @property
    def size(self) -> int:
        """Number of control points."""
        return self.knots.shape[0] - 1 if self.periodic else self.knots.shape[0] - self.degree - 1

    @property
    def domain(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """First and last parameter."""
        if self.periodic:
            return self.knots[0], self.knots[-1]
        return self.knots[self.degree], self.knots[self.size]

    @property
    def unrolled_knots(self) -> Float[Array, "k2"]:
        """The knots of the ordinary basis: periodic ones continued by `degree` on both sides."""
        return extend_periodic(self.knots, self.degree) if self.periodic else self.knots

    def local(self, u: Float[Array, ""]) -> tuple[Int[Array, ""], list[Float[Array, ""]]]:
        """Index of the first function that does not vanish around `u`, and the values of all `degree + 1`.

        The index is unrolled; `control_index` maps it to a control point.
        """
        places, coefficients = span_polynomials(self.unrolled_knots, self.degree)
        first, t, _ = self.place(u, places)
        # Horner on rows of degree + 1 numbers: one loop that the compiler keeps whole. De Boor's triangle
        # point by point has 12 divisions for a cubic and twice the time.
        values = take(coefficients[self.degree], first)
        for power in range(self.degree - 1, -1, -1):
            values = values * t + take(coefficients[power], first)
        return first, [values[i] for i in range(self.degree + 1)]

    def derivatives(self, u: Float[Array, ""], order: int) -> tuple[Int[Array, ""], Float[Array, "orders q"]]:
        """Index as of `local`, and the `degree + 1` values with their derivatives to an order, by rows."""
        places, coefficients = span_polynomials(self.unrolled_knots, self.degree)
        first, t, slope = self.place(u, places)
        row = jnp.stack([take(functions, first) for functions in coefficients])
        rows = []
        for _ in range(order + 1):
            total = row[-1] if len(row) else jnp.zeros(self.degree + 1, self.knots.dtype)
            for power in range(len(row) - 2, -1, -1):
                total = total * t + row[power]
            rows.append(total)
            row = row[1:] * (slope * jnp.arange(1, max(len(row), 1), dtype=t.dtype)).reshape(-1, 1)
        return first, jnp.stack(rows)

    def span(self, u: Float[Array, ""]) -> Int[Array, ""]:
        """Index of the first function that does not vanish around `u`, inside one period: the number of its span."""
        return _steps_passed(_inner_steps(self.unrolled_knots, self.degree), u)

    def wrapped(self, u: Float[Array, ""]) -> Float[Array, ""]:
        """A parameter inside one period; of what is not periodic, as it is."""
        return _wrap(u, self.knots) if self.periodic else u

    def place(self, u: Float[Array, ""], places: Places) -> tuple[Int[Array, ""], Float[Array, ""], Float[Array, ""]]:
        """Index of the first function that does not vanish around `u`, the place t in its span, and dt/du; `places` are
        those of `span_polynomials`."""
        u = self.wrapped(u)
        first = _steps_passed(places.steps, u)
        slope = take(places.scale, first)
        return first, (u - take(places.middle, first)) * slope, slope

    def near(self, u: Float[Array, ""]) -> tuple[Int[Array, ""], Float[Array, "w"], Float[Array, ""]]:
        """Index of the first function that does not vanish around `u`, the knots that those functions need,
        and `u`, wrapped if periodic."""
        p, knots = self.degree, self.unrolled_knots
        u = self.wrapped(u)
        first = self.span(u)
        # One gather of a row of 2p neighbouring knots per point; the table is built once per call.
        spans = knots.shape[0] - 2 * p - 1
        table = jnp.stack([knots[1 + i : 1 + i + spans] for i in range(2 * p)], axis=1)
        return first, take(table, first), u

    def control_index(self, first: Int[Array, "..."], offset: int | Int[Array, "..."]) -> Int[Array, "..."]:
        """The control point of unrolled function `first + offset`."""
        index = first + offset
        return index % self.size if self.periodic else index

    def unroll(self, rows: Float[Array, "n ..."]) -> Float[Array, "n2 ..."]:
        """Control data by unrolled index: periodic rows are continued by `degree` of them."""
        return rows[np.arange(self.size + self.degree) % self.size] if self.periodic else rows

    def row(self, u: Float[Array, ""]) -> Float[Array, "n"]:
        """Values of all `n` functions at one parameter, most of them 0."""
        first, values = self.local(u)
        zeros = jnp.zeros(self.size, self.knots.dtype)
        for i, value in enumerate(values):
            zeros = zeros.at[self.control_index(first, i)].add(value, mode="promise_in_bounds")
        return zeros

    def matrix(self, u: Float[Array, "m"]) -> Float[Array, "m n"]:
        """Collocation matrix: values of all functions at many parameters."""
        return jax.vmap(self.row)(u)


def span_polynomials(knots: Float[Array, "k"], degree: int) -> tuple[Places, list[Float[Array, "spans q"]]]:
    """The basis on every span as polynomials in t = (u - middle) · scale, which runs over [-1, 1].

    Returns where the spans are and, by power of t, the coefficients of the `degree + 1` functions that do not
    vanish. Powers about the middle lose little: values are within 1e-15 to degree 19. Empty spans get zeros;
    they are never looked up.
    """
    spans = knots.shape[0] - 2 * degree - 1
    near = jnp.stack([knots[1 + i : 1 + i + spans] for i in range(2 * degree)], axis=1)
    start, end = near[:, degree - 1], near[:, degree]
    middle = (start + end) / 2
    scale = divide(jnp.full_like(start, 2), end - start)
    # The NURBS Book, A2.2, on arrays (span, function, power). With one margin of zeros the compiler makes one loop
    # of each level; a pad for every term would be five.
    places = jnp.pad((near - middle[:, None]) * scale[:, None], ((0, 0), (1, 1)))[:, :, None]
    values = jnp.ones((spans, 1, 1), knots.dtype)
    p = degree
    for d in range(1, p + 1):
        left, right = places[:, p - d + 1 : p + 1], places[:, p + 1 : p + 1 + d]
        share = jnp.pad(divide(values, right - left), ((0, 0), (1, 1), (1, 1)))
        own, other = share[:, 1:], share[:, :-1]  # of the function itself, and of the one before it
        left, right = places[:, p - d : p + 1], places[:, p + 1 : p + 2 + d]
        values = (right * own[:, :, 1:] - own[:, :, :-1]) + (other[:, :, :-1] - left * other[:, :, 1:])
    return Places(_inner_steps(knots, degree), middle, scale), [values[:, :, power] for power in range(degree + 1)]


def local_values(near: list[Float[Array, ""]], degree: int, u: Float[Array, ""]) -> list[Float[Array, ""]]:
    """The `degree + 1` nonzero basis values from the 2·degree knots around a non-empty span (The NURBS Book,
    A2.2)."""
    values = [jnp.ones_like(u)]
    for d in range(1, degree + 1):
        carried = jnp.zeros_like(u)
        raised = []
        for r in range(d):
            left, right = near[degree + r - d], near[degree + r]
            share = values[r] / (right - left)
            raised.append(carried + (right - u) * share)
            carried = (u - left) * share
        values = [*raised, carried]
    return values


def _inner_steps(knots: Float[Array, "k"], degree: int) -> Float[Array, "inner"]:
    """The inner knots, for `_steps_passed`. Knots equal to an end of the domain never count as passed or passable, so the
    span found is not empty, whatever the end multiplicities and wherever the parameter is."""
    start, end = knots[degree], knots[-degree - 1]
    inner = knots[degree + 1 : -degree - 1]
    return jnp.where(inner <= start, -jnp.inf, jnp.where(inner >= end, jnp.inf, inner))


def _steps_passed(steps: Float[Array, "inner"], u: Float[Array, ""]) -> Int[Array, ""]:
    """How many are at or below `u`: the number of its span, and of the first function that does not vanish there."""
    return _bisect(steps, u) if steps.shape[0] > _SCAN_LIMIT else jnp.sum(u >= steps, dtype=jnp.int32)


def _bisect(steps: Float[Array, "k"], u: Float[Array, ""]) -> Int[Array, ""]:
    """Count the steps at or below `u` by bisection, unrolled: `jnp.searchsorted` loops, and takes twice the time."""
    levels = steps.shape[0].bit_length()
    padded = jnp.pad(steps, (0, 2**levels - steps.shape[0]), constant_values=jnp.inf)
    count = jnp.zeros((), jnp.int32)
    for level in range(levels - 1, -1, -1):
        count = count + jnp.where(u >= take(padded, count + (2**level - 1)), 2**level, 0).astype(jnp.int32)
    return count


def _wrap(u: Float[Array, ""], knots: Float[Array, "k"]) -> Float[Array, ""]:
    """Move `u` by whole periods into the domain; inside it nothing is rounded."""
    period = knots[-1] - knots[0]
    return u - period * jax.lax.stop_gradient(jnp.floor((u - knots[0]) / period))
