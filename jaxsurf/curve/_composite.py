"""Curves joined end to end."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arguments import as_type, early
from .._array import concrete, eps, is_concrete
from .._errors import InputError
from .._registry import register
from ._abstract import AbstractCurve
from ._breaks import breaks


@register
class CompositeCurve(AbstractCurve):
    """Curves of any kind run through one after the other, each at its own speed.

    The domain starts at the first piece's own first parameter and is as long as the pieces' domains together;
    `breaks` are where the pieces meet. At a break the next piece counts, at the end the last; outside the
    domain the first and the last piece continue. All arrays take the widest floating type among the pieces.
    Raises `InputError` if there is no piece, if they differ in dimension or, on concrete data, if ends are
    further apart than `tolerance` times the size of the whole (never below 32 roundings). Each point
    evaluates every piece.
    """

    pieces: tuple[AbstractCurve, ...]

    def __init__(self, pieces: Sequence[Any], *, tolerance: float = 1e-6):
        pieces = tuple(pieces)
        for i, piece in enumerate(pieces):
            if not isinstance(piece, AbstractCurve):
                raise InputError(f"`pieces[{i}]` must be a curve, got {type(piece).__name__}.")
        if not pieces:
            raise InputError("`pieces` must hold at least one curve, got none.")
        self.pieces = as_type(pieces, max((p.dtype for p in pieces), key=lambda dtype: jnp.finfo(dtype).bits))
        _check_dimensions(self.pieces)
        _check_ends_meet(self.pieces, tolerance)

    @property
    def breaks(self) -> Float[Array, "n"]:
        """The parameters where pieces begin, and the last one: one more than there are pieces."""
        ends = [piece.domain for piece in self.pieces]
        steps = [jnp.asarray(ends[0][0], self.dtype), *(jnp.asarray(b - a, self.dtype) for a, b in ends)]
        return jnp.cumsum(jnp.stack(steps))

    @property
    def domain(self) -> tuple[Any, Any]:
        breaks = self.breaks
        return breaks[0], breaks[-1]

    def point(self, u: Float[Array, ""]) -> Float[Array, "d"]:
        breaks = self.breaks
        index = jnp.sum(u >= breaks[1:-1], dtype=jnp.int32)
        places = []
        for i, piece in enumerate(self.pieces):
            first, last = piece.domain
            # a piece that is not chosen is evaluated amid its domain: at an end 0 · inf might be NaN
            places.append(piece.point(jnp.where(index == i, first + (u - breaks[i]), (first + last) / 2)))
        return jax.lax.select_n(index, *places)


@breaks.register(CompositeCurve)
def _(shape: CompositeCurve) -> Any:
    starts = shape.breaks[:-1]
    moved = [breaks(piece) + (starts[i] - piece.domain[0]) for i, piece in enumerate(shape.pieces)]
    if is_concrete(moved):
        return np.unique(np.concatenate([concrete(places) for places in moved]))
    return jnp.concatenate(moved)


def _check_dimensions(pieces: tuple[AbstractCurve, ...]) -> None:
    sizes = [eqx.filter_eval_shape(piece.point, jnp.zeros((), piece.dtype)).shape[0] for piece in pieces]
    if len(set(sizes)) > 1:
        raise InputError(f"`pieces` must have one dimension, got {sizes}.")


def _check_ends_meet(pieces: tuple[AbstractCurve, ...], tolerance: float) -> None:
    if len(pieces) == 1 or not is_concrete(pieces):
        return
    places = [concrete(early(_ends_and_middle, piece)) for piece in pieces]
    size = float(np.linalg.norm(np.ptp(np.concatenate(places), axis=0)))
    allowed = max(tolerance, 32 * eps(places[0].dtype)) * size
    for i, (before, after) in enumerate(zip(places[:-1], places[1:], strict=True)):
        distance = float(np.linalg.norm(after[0] - before[-1]))
        if distance > allowed:
            raise InputError(
                f"`pieces[{i}]` ends {distance:.3g} from where `pieces[{i + 1}]` starts; at most "
                f"{allowed:.3g} (`tolerance` × size) is allowed: move the ends together, or reverse a piece."
            )


def _ends_and_middle(piece: AbstractCurve) -> Float[Array, "3 d"]:
    first, last = piece.domain
    return piece(jnp.stack([jnp.asarray(u, piece.dtype) for u in (first, (first + last) / 2, last)]))
