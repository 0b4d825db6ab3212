"""How much patches move and bend by the normals along their seams."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._safe import divide, norm, unit
from ._edge_fields import bernstein
from ._ribbons import CORNERS
from ._seam_polynomials import DEGREE, GAUSS, fairness_tables, gauss
from ._seam_reads import Read, SeamClass

_NEAR = 400.0  # weight of |D|², next to |D_uu|² + 2 |D_uv|² + |D_vv|², on patches of unit size


def fairness(
    kind: SeamClass, read: Read, parts: Any, base: Array, bends: Array, chosen: Array, known: Any
) -> tuple[Array, Array]:
    """Square matrices and right sides, per patch, of ∬ |D_uu|² + 2 |D_uv|² + |D_vv|² + 400 |D|², D what H does to it, over
    the four numbers of each seam about it, at the present ones."""
    g, quadrature = (np.asarray(x) for x in gauss())
    sides = kind.sides
    turning, lengths = known
    slots = len(sides)
    bent, derive = (jnp.asarray(x, base.dtype) for x in fairness_tables())

    places = jnp.asarray(g, base.dtype)[None]
    of_side = jnp.asarray(sides == np.arange(4)[:, None], base.dtype)

    def pulled(m: Array, x: Array, t: Array) -> Array:
        m = unit(m - (m @ t) * t)
        return (x @ m) * m

    def side_terms(read: Read, at: Any, seams: Array, turned: Array) -> tuple[Array, Array]:
        """⟨X, M⟩ M at the Gauss places of the sides (4, g, 3), and its derivatives (4, g, 3, slots, 4)."""
        first, last = (jnp.concatenate([side[part] for side in at])[:, None] for part in (np.s_[:-1], np.s_[1:]))
        share = (places - first) / (last - first)
        share = jnp.where(turned[:, None], 1 - share, share)
        inside = (places > first) & (places <= last)
        weights = jnp.where(inside[..., None], bernstein(share, DEGREE), 0)
        vectors = base[seams] + jnp.einsum("pa,padx->pdx", chosen[seams], bends[seams], precision="highest")
        m = jnp.einsum("sp,pgd,pdx->sgx", of_side, weights, vectors, precision="highest")
        by = jnp.einsum("pgd,padx->pgax", weights, bends[seams], precision="highest")
        across, along = (
            jnp.concatenate([jnp.swapaxes(x[:GAUSS], 0, 1) for x in pair]) for pair in (read.across, read.along)
        )
        every = lambda f: jax.vmap(jax.vmap(f))(m, across, unit(along))
        turn = every(jax.jacfwd(pulled))
        return every(pulled), jnp.einsum("sp,sgyx,pgax->sgypa", of_side, turn, by, precision="highest")

    def one(read: Read, at: Any, seams: Array, turned: Array, held: Array) -> tuple[Array, Array]:
        value, by = side_terms(read, at, seams, turned)
        pulls = jnp.concatenate([value[..., None], by.reshape(4, GAUSS, 3, -1)], axis=-1) * held[:, None, None, None]
        corners = _corner_terms(kind, read, seams, turned, held, chosen, turning, lengths)
        weight = jnp.asarray(quadrature, base.dtype)
        size = jnp.mean(norm(read.first), axis=(0, 1))
        scale = divide(jnp.ones((), base.dtype), size[0] * size[1])
        square, linear = jnp.zeros((4 * slots, 4 * slots), base.dtype), jnp.zeros(4 * slots, base.dtype)
        for du, dv, factor in ((2, 0, 1.0), (1, 1, 2.0), (0, 2, 1.0), (0, 0, _NEAR)):
            moved = jnp.einsum("ia,bc,icxq->abxq", bent[du], derive[dv], pulls[:2], precision="highest")
            moved = moved + jnp.einsum("jb,ac,jcxq->abxq", bent[dv], derive[du], pulls[2:], precision="highest")
            moved = moved - jnp.einsum("ia,jb,ijxq->abxq", bent[du], bent[dv], corners, precision="highest")
            value, by = moved[..., 0], moved[..., 1:]
            square = square + factor * scale * jnp.einsum("a,b,abxp,abxq->pq", weight, weight, by, by, precision="highest")
            linear = linear + factor * scale * jnp.einsum("a,b,abxp,abx->p", weight, weight, by, value, precision="highest")
        return square, linear

    return jax.vmap(one)(read, parts, jnp.asarray(kind.seams), jnp.asarray(kind.turned), jnp.asarray(kind.held, base.dtype))


def _corner_terms(
    kind: SeamClass, read: Read, seams: Array, turned: Array, held: Array, chosen: Array, turning: Array, lengths: Array
) -> Array:
    """½ (ρ + ρ̃) n at the corners of a patch, and its derivatives by the numbers of the seams, (2, 2, 3, 1 + 4 slots)."""
    starts = np.cumsum((0, *kind.counts))
    slots = int(starts[-1])
    corners = np.array(CORNERS)
    # at a corner (i, j) the side u = i, whose end there is its j-th, and the side v = j
    about, last = corners + np.array([0, 2]), corners[:, ::-1]
    slot = np.where(last, starts[about + 1] - 1, starts[about])
    du, dv = jnp.moveaxis(read.first.reshape(4, 2, 3), 1, 0)
    across = jnp.cross(du, dv)
    n, area, inner = unit(across), norm(across), jnp.sum(du * dv, axis=-1)
    second = jnp.einsum("cabx,cx->cab", read.second.reshape(4, 2, 2, 3), n, precision="highest")
    # ⟨S_u, M_i'⟩ = −area x_i − ⟨S_u, S_v⟩ ⟨S_vv, n⟩ / |S_v|², and ⟨S_v, M_j'⟩ = area x_j − …
    bent = divide(second[:, 0, 0], jnp.sum(du * du, axis=-1)) + divide(second[:, 1, 1], jnp.sum(dv * dv, axis=-1))
    seam, end = seams[slot], jnp.where(turned[slot], 1 - last, last)
    share = divide(0.5 * area[:, None] * jnp.asarray([[-1.0, 1.0]], chosen.dtype), lengths[seam, end])
    mean = second[:, 0, 1] - 0.5 * inner * bent + jnp.sum(share * (chosen[seam, end] + turning[seam, end]), axis=1)
    rows = jnp.zeros((4, 1 + 4 * slots), chosen.dtype).at[:, 0].set(mean)
    rows = rows.at[np.arange(4)[:, None], 1 + 4 * slot + end].add(share)
    rows = rows * (held[corners[:, 0]] * held[2 + corners[:, 1]])[:, None]
    return (n[:, :, None] * rows[:, None, :]).reshape(2, 2, 3, -1)
