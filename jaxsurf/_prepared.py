"""Shapes made ready for many points: what does not depend on the parameters is computed once."""

from typing import Any

import equinox as eqx
import jax


class Preparable(eqx.Module):
    """A shape of which `prepared` gives one that evaluates the same points, and may be quicker at it."""

    def prepared(self) -> Any:
        """The same shape with all shapes inside it prepared; one that has tables to build does so here."""
        return jax.tree.map(_prepare_leaf, self, is_leaf=lambda node: node is not self and isinstance(node, Preparable))

    def roughened(self) -> Any:
        """The same shape, ready for places to about a thousandth of its size, where that is less work."""
        return jax.tree.map(_roughen_leaf, self, is_leaf=lambda node: node is not self and isinstance(node, Preparable))

    def renewed(self) -> Any:
        """The same shape, made ready for its present control data too: it may have bent further than it was ready for."""
        return self


def prepare(tree: Any) -> Any:
    """The tree with every shape in it prepared; call it outside of loops over points."""
    return jax.tree.map(_prepare_leaf, tree, is_leaf=lambda node: isinstance(node, Preparable))


def roughen(tree: Any) -> Any:
    """The tree with every shape in it ready for rough places only, for what needs no more: approximate derivatives."""
    return jax.tree.map(_roughen_leaf, tree, is_leaf=lambda node: isinstance(node, Preparable))


def point_of(shape: Any, *parameters: jax.Array) -> jax.Array:
    """The point of a curve or surface at one parameter or pair, for `map_points`."""
    return shape.point(*parameters)


def _prepare_leaf(node: Any) -> Any:
    return node.prepared() if isinstance(node, Preparable) else node


def _roughen_leaf(node: Any) -> Any:
    return node.roughened() if isinstance(node, Preparable) else node
