"""Known parameters: the net of least squares against scipy's design matrices and sparse solve."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

import jaxsurf as js
from jaxsurf.fit._bending import bending_of
from jaxsurf.fit._linear import linear_fit

from .harness import Figure, Row, Run

POINTS, SIDE, DEGREE = 300_000, 20, 3
OURS, THEIRS = "linear_fit", "scipy design matrices, sparse solve"
_WEIGHT = 1e-9


def rows() -> list[Row]:
    """300 000 points on a bicubic net of 20 × 20 control points, in double precision; the nets must agree to 1e-9."""
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(0)
    parameters = rng.uniform(size=(POINTS, 2))
    u, v = parameters.T
    points = np.stack([10 * u, 7 * v, np.sin(3 * u) * np.cos(2 * v)], -1) + 0.01 * rng.normal(size=(POINTS, 3))
    knots = js.clamped_knots(SIDE, DEGREE)
    flat = js.BSplineSurface(np.zeros((SIDE, SIDE, 3)), knots, knots, DEGREE, DEGREE)
    bending: Any = bending_of(flat, (10.0, 7.0))
    given = [jnp.asarray(x) for x in (points, parameters, np.ones(POINTS))]
    ours = lambda: jax.block_until_ready(linear_fit(flat, given[0], given[1], given[2], bending, _WEIGHT))
    theirs = lambda: _scipy(points, parameters, np.asarray(knots), np.asarray(bending))
    gap = np.abs(np.asarray(ours()).reshape(-1, 3) - theirs()).max()
    assert gap < 1e-9, gap
    runs: dict[str, Run | None] = {OURS: Run(ours, POINTS), THEIRS: Run(theirs, POINTS)}
    figures = [Figure("rate", OURS, None, 1e-6 * POINTS / 0.5), Figure("faster", OURS, THEIRS, 3.0)]
    return [Row(f"a net of {SIDE} × {SIDE} control points through {POINTS:.0e} points at known parameters", runs, figures)]


def _scipy(points: np.ndarray, parameters: np.ndarray, knots: np.ndarray, bending: np.ndarray) -> np.ndarray:
    along: list[Any] = [BSpline.design_matrix(t, knots, DEGREE) for t in parameters.T]
    count, terms = len(points), DEGREE + 1
    index = [matrix.indices.reshape(count, terms) for matrix in along]
    value = [matrix.data.reshape(count, terms) for matrix in along]
    columns = (index[0][:, :, None] * SIDE + index[1][:, None, :]).ravel()
    values = (value[0][:, :, None] * value[1][:, None, :]).ravel()
    design = csr_matrix((values, columns, np.arange(count + 1) * terms**2), shape=(count, SIDE**2))
    matrix = (design.T @ design) / count + csr_matrix(_WEIGHT * bending)
    net: Any = spsolve(matrix.tocsc(), design.T @ points / count)
    return net
