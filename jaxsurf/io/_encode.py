"""From a tree of modules, containers and arrays to plain JSON and a list of arrays."""

import dataclasses
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from .._registry import registered_class


def encode(value: Any, place: str, arrays: list[np.ndarray]) -> object:
    """`value` as JSON; its arrays are appended to `arrays` and mentioned by number.

    `place` says where in the tree we are. Raises `InputError` on what a file cannot hold.
    """
    kind = type(value)  # not isinstance: a subclass of int or tuple would come back as its base
    if value is None or kind in (bool, int, str):
        return value
    if kind is float:
        return {"float": repr(value)}
    if kind is complex:
        return {"complex": [repr(value.real), repr(value.imag)]}
    if kind in (list, tuple):
        return {kind.__name__: [encode(item, f"{place}[{i}]", arrays) for i, item in enumerate(value)]}
    if kind is dict:
        for key in value:
            if type(key) is not str:
                raise InputError(f"Cannot save `{place}`: expected strings as keys, got {key!r}; rename the key.")
        return {"dict": {key: encode(item, f"{place}[{key!r}]", arrays) for key, item in value.items()}}
    if isinstance(value, (jax.Array, np.generic)) or kind in (np.ndarray, np.memmap):
        return _encode_array(value, place, arrays)
    name = getattr(value, "__name__", None)
    if isinstance(name, str) and registered_class(name) is value:
        return {"registered": name}
    if registered_class(kind.__name__) is kind and dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value)]
        return {
            "class": kind.__name__,
            "fields": {name: encode(getattr(value, name), f"{place}.{name}", arrays) for name in fields},
        }
    if callable(value) and not dataclasses.is_dataclass(value):
        raise InputError(
            f"Cannot save `{place}`: it is the function {name or repr(value)[:60]!r}, and a file cannot hold "
            "code; convert the shape with `to_bspline` first, or give one of the library's own functions."
        )
    raise InputError(
        f"Cannot save `{place}`: the class {kind.__name__!r} is not registered; decorate it with "
        "`jaxsurf.register`, or convert the shape with `to_bspline` first."
    )


def _encode_array(value: jax.Array | np.ndarray | np.generic, place: str, arrays: list[np.ndarray]) -> object:
    node = {"array": len(arrays), "kind": "scalar" if isinstance(value, np.generic) else "numpy"}
    array = value
    if isinstance(value, jax.Array):
        if isinstance(value, jax.core.Tracer):
            raise InputError(f"Cannot save `{place}`: it is traced and has no value yet; save outside of jit.")
        if value.is_deleted():
            raise InputError(f"Cannot save `{place}`: its array was deleted or donated; save before it is.")
        if not value.is_fully_addressable:
            raise InputError(f"Cannot save `{place}`: its array lies on several machines; gather it first.")
        node["kind"] = "jax"
        if jnp.issubdtype(value.dtype, jax.dtypes.prng_key):
            node |= {"kind": "key", "implementation": str(jax.random.key_impl(value))}
            array = jax.random.key_data(value)
    array = np.asarray(array)
    if array.dtype.hasobject or array.dtype.names is not None:
        raise InputError(f"Cannot save `{place}`: its array has the dtype {array.dtype}; expected plain numbers.")
    if node["kind"] in ("jax", "key"):
        array = array.astype(array.dtype.newbyteorder("<"), copy=False)
    node |= {"dtype": array.dtype.name, "shape": list(array.shape)}
    if array.dtype.isbuiltin == 2:  # bfloat16 and its kin, which .npy does not know: keep their bits
        array = np.array(array, order="C").view(f"<u{array.dtype.itemsize}")
    arrays.append(array)
    return node
