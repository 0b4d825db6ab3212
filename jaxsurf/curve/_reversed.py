"""The other way round: control data of a spline run backwards."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


@eqx.filter_jit
def reversed_spline(
    net: Float[Array, "n *rest"], knots: Float[Array, "k"], degree: int, periodic: bool
) -> tuple[Float[Array, "n *rest"], Float[Array, "k"]]:
    """Control data and knots of the spline that runs backwards over the same domain; first axis of `net`.

    Knot t becomes a + b - t with the domain [a, b]. A periodic net is also rolled, since its first function
    ends, and does not start, with the domain's first span.
    """
    if periodic:
        a, b = knots[0], knots[-1]
        net = jnp.roll(net, -degree, axis=0)
    else:
        a, b = knots[degree], knots[-degree - 1]
    mirrored = jnp.where(knots == a, b, jnp.where(knots == b, a, (a - knots) + b))  # the ends stay exact
    return net[::-1], mirrored[::-1]
