"""From plain JSON and a list of arrays back to the tree of modules, containers and arrays."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from .._registry import registered_class, registered_names
from ._npy import array_from_npy
from ._source import refusal


class Decoder:
    """Builds the tree of one file; `entries` are its .npy entries by name."""

    def __init__(self, path: Path, entries: dict[str, bytes]):
        self.path = path
        self.entries = entries
        self.makers: dict[str, Callable[[dict, str], object]] = {
            "float": lambda node, place: float(node["float"]),
            "complex": lambda node, place: complex(*map(float, node["complex"])),
            "list": lambda node, place: self._items(node["list"], place),
            "tuple": lambda node, place: tuple(self._items(node["tuple"], place)),
            "dict": lambda node, place: {k: self.decode(v, f"{place}[{k!r}]") for k, v in node["dict"].items()},
            "array": self._array,
            "registered": lambda node, place: self._class(node["registered"], place),
            "class": self._module,
        }

    def decode(self, node: object, place: str) -> object:
        """The value of a JSON node; `place` is where in the tree it belongs."""
        if node is None or isinstance(node, (bool, int, str)):
            return node
        if isinstance(node, dict):
            for kind, make in self.makers.items():
                if kind in node:
                    try:
                        return make(node, place)
                    except InputError:
                        raise
                    except (
                        TypeError,
                        ValueError,
                        KeyError,
                        AttributeError,
                        IndexError,
                        OverflowError,
                    ) as error:
                        raise self._damaged(place) from error
        raise self._damaged(place)

    def _damaged(self, place: str) -> InputError:
        return refusal(
            self.path,
            f"the description of `{place}` in it is damaged or of an unknown kind; save the shape again",
        )

    def _items(self, nodes: list, place: str) -> list:
        return [self.decode(node, f"{place}[{i}]") for i, node in enumerate(nodes)]

    def _class(self, name: str, place: str) -> type:
        found = registered_class(name)
        if found is None:
            raise refusal(
                self.path,
                f"`{place}` is of the class {name!r}, which is not known here; "
                "import the module that registers it, or upgrade jaxsurf "
                f"(known: {', '.join(registered_names())})",
            )
        return found

    def _module(self, node: dict, place: str) -> object:
        cls = self._class(node["class"], place)
        expected = [field.name for field in dataclasses.fields(cls)]
        missing = [name for name in expected if name not in node["fields"]]
        unknown = [name for name in node["fields"] if name not in expected]
        if missing or unknown:
            which = f"lacks the field {missing[0]!r}" if missing else f"has the unknown field {unknown[0]!r}"
            raise refusal(
                self.path,
                f"`{place}` of the class {cls.__name__!r} {which} "
                f"(expected {', '.join(expected) or 'none'}); it was saved by another version, "
                "use that one or build the shape again",
            )
        # Around __init__, converters and checks: what was saved comes back bit by bit.
        module = object.__new__(cls)
        for name in expected:
            object.__setattr__(module, name, self.decode(node["fields"][name], f"{place}.{name}"))
        return module

    def _array(self, node: dict, place: str) -> object:
        name = f"arrays/{node['array']}.npy"
        if name not in self.entries:
            raise refusal(self.path, f"the array of `{place}` is missing in it; save the shape again")
        array = array_from_npy(self.path, self.entries[name], name=f"the array of `{place}`")
        if array.dtype.name != node["dtype"]:  # bfloat16 and its kin lie there as their bits
            array = array.view(np.dtype(node["dtype"]))
        if array.dtype.name != node["dtype"] or list(array.shape) != node["shape"]:
            raise self._damaged(place)
        match node["kind"]:
            case "numpy":
                return array.copy(order="K")
            case "scalar":
                return array[()]
            case "jax":
                return self._jax_array(array, place)
            case "key":
                return jax.random.wrap_key_data(self._jax_array(array, place), impl=node["implementation"])
        raise self._damaged(place)

    def _jax_array(self, array: np.ndarray, place: str) -> jax.Array:
        if jax.dtypes.canonicalize_dtype(array.dtype) != array.dtype:
            raise refusal(
                self.path,
                f"`{place}` is {array.dtype.name}, which JAX would cut to 32 bits now; call "
                '`jax.config.update("jax_enable_x64", True)` first',
            )
        return jnp.array(array)
