"""`save` and `load`: bit by bit, and every refusal."""

import io
import json
import signal
import subprocess
import sys
import zipfile
from collections import namedtuple
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsurf._errors import InputError
from jaxsurf._registry import register
from jaxsurf.io._native import load, save


@register
class NativeCurve(eqx.Module):
    control_points: jax.Array = eqx.field(converter=jnp.asarray)
    degree: int = eqx.field(static=True)

    def __init__(self, points):
        self.control_points = points * 2  # what load must not run
        self.degree = 3

    def __check_init__(self):
        if self.degree != 3:
            raise AssertionError("load must not run this")


@register
class NativePair(eqx.Module):
    first: Any
    second: Any
    name: str = eqx.field(static=True, default="pair")


@register
class NativeNothing(eqx.Module):
    pass


class Unregistered(eqx.Module):
    x: Any = 1


@pytest.fixture
def path(tmp_path):
    return tmp_path / "shape.jxs"


@pytest.fixture
def x64():
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


def round_trip(path, shape):
    save(path, shape)
    return load(path)


def same_bits(a, b):
    return type(a) is type(b) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def test_a_module_comes_back_around_its_constructor(path, x64):
    curve = NativeCurve(jnp.array([[0.1, np.pi, -0.0], [np.nan, np.inf, 5e-324]]))
    found = round_trip(path, curve)
    assert type(found) is NativeCurve and found.degree == 3
    assert isinstance(found.control_points, jax.Array)
    assert same_bits(np.asarray(found.control_points), np.asarray(curve.control_points))
    assert jax.tree.structure(found) == jax.tree.structure(curve)
    with pytest.raises(AttributeError):
        found.degree = 4  # still frozen


def test_containers_and_scalars(path):
    tree = {
        "tuple": (1, 2.5, None, True, 'Gehäuse \ud800 \n"', ()),
        "list": [[], [-0.0, 1e308, 5e-324, float("inf"), 0.1 + 0.2], {}],
        "": {"class": 1, "float": "x", "array": (0,)},
        "big": -(10**30),
        "complex": complex(-0.0, 0.1),
        "pair": NativePair(NativeNothing(), (NativePair(None, [NativeNothing, NativeCurve]),), name="named"),
    }
    found = round_trip(path, tree)
    assert repr({**found, "pair": 0}) == repr({**tree, "pair": 0}) and list(found) == list(tree)
    assert found["pair"].name == "named" and type(found["pair"].first) is NativeNothing
    assert found["pair"].second[0].second == [NativeNothing, NativeCurve]
    assert np.isnan(round_trip(path, float("nan")))


DTYPES = [
    "bool",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "float16",
    "float32",
    "complex64",
    "bfloat16",
    "float8_e4m3fn",
    "int4",
]


@pytest.mark.parametrize("shape", [(), (0, 3), (2, 3)])
@pytest.mark.parametrize("dtype", DTYPES)
def test_jax_arrays_of_every_dtype(path, dtype, shape):
    array = jnp.asarray(np.random.default_rng(1).integers(0, 2, shape), dtype=dtype)
    found = round_trip(path, [array])[0]
    assert isinstance(found, jax.Array)
    assert same_bits(np.asarray(found), np.asarray(array))


@pytest.mark.parametrize("dtype", [*DTYPES, "float64", "int64", "uint64", "complex128", "longdouble"])
def test_numpy_arrays_of_every_dtype(path, dtype):
    array = np.arange(6).reshape(2, 3).astype(jnp.dtype(dtype))
    for each in (array, np.asfortranarray(array), array[:, ::2], array[:0], array[0, 0]):
        found = round_trip(path, [each])[0]
        assert same_bits(found, each)
    assert round_trip(path, [array])[0].flags.writeable


def test_other_numpy_arrays(path):
    for array in (
        np.array(["a", "üb"]),
        np.array([b"x"]),
        np.array(["2020-01-01"], "M8[D]"),
        np.arange(3.0).astype(">f8"),
    ):
        assert same_bits(round_trip(path, [array])[0], array)
    for scalar in (np.float64(0.1), np.int8(3), np.bool_(True), np.str_("x")):
        assert same_bits(round_trip(path, scalar), scalar)


def test_random_keys(path):
    for implementation in ("threefry2x32", "rbg"):
        key = jax.random.key(3, impl=implementation)
        found = round_trip(path, (key,))[0]
        assert found.dtype == key.dtype and (jax.random.key_data(found) == jax.random.key_data(key)).all()


def test_the_same_shape_gives_the_same_bytes(tmp_path):
    tree = (NativeCurve(jnp.ones((2, 3), jnp.float32)), {"b": 1, "a": 2})
    save(tmp_path / "a", tree)
    save(str(tmp_path / "b"), load(tmp_path / "a"))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_64_bits_are_not_cut(path, x64):
    save(path, {"curve": NativeCurve(jnp.ones((2, 3)))})
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(InputError, match=r"`shape\['curve'\].control_points` is float64, .*jax_enable_x64"):
        load(path)


def cyclic():
    tree = []
    tree.append(tree)
    return tree


Named = namedtuple("Named", "x")


@pytest.mark.parametrize(
    "tree, match",
    [
        (
            NativePair([1, lambda t: t], 0),
            r"`shape.first\[1\]`: it is the function '<lambda>', and a file cannot hold code",
        ),
        ({"a": jax.jit(lambda t: t)}, r"`shape\['a'\]`: it is the function"),
        (
            NativePair(0, (Unregistered(),)),
            r"`shape.second\[0\]`: the class 'Unregistered' is not registered",
        ),
        (Named(1), "`shape`: the class 'Named' is not registered"),
        ({1, 2}, "the class 'set' is not registered"),
        (b"x", "the class 'bytes' is not registered"),
        ([jax.ShapeDtypeStruct((3,), "float32")], "the class 'ShapeDtypeStruct' is not registered"),
        (np.ma.masked_array([1, 2], [True, False]), "the class 'MaskedArray' is not registered"),
        ({1: 2}, "expected strings as keys, got 1"),
        (np.array([None]), "its array has the dtype object"),
        (np.zeros(2, [("a", "f8")]), "its array has the dtype"),
        (cyclic(), "nested too deeply, or holds itself"),
    ],
)
def test_what_cannot_be_saved(path, tree, match):
    path.write_bytes(b"old")
    with pytest.raises(InputError, match=match):
        save(path, tree)
    assert path.read_bytes() == b"old" and len(list(path.parent.iterdir())) == 1


def test_arrays_without_values(path):
    with pytest.raises(InputError, match=r"`shape\[0\]`: it is traced"):
        jax.jit(lambda x: save(path, [x]))(jnp.ones(3))
    array = jnp.ones(3)
    array.delete()
    with pytest.raises(InputError, match="deleted or donated"):
        save(path, array)


def test_where_nothing_can_be_written(tmp_path):
    with pytest.raises(InputError, match="does not exist; create it first"):
        save(tmp_path / "none" / "shape.jxs", 1)
    with pytest.raises(InputError, match="it is a folder"):
        save(tmp_path, 1)


def archive(header, **entries):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("jaxsurf.json", header if isinstance(header, str) else json.dumps(header))
        for name, content in entries.items():
            file.writestr(f"arrays/{name}.npy", content)
    return stream.getvalue()


def tree(node, **entries):
    return archive({"format": "jaxsurf", "version": 1, "tree": node}, **entries)


def foreign_zip():
    stream = io.BytesIO()
    zipfile.ZipFile(stream, "w").close()
    return stream.getvalue()


ARRAY = {"array": 0, "kind": "jax", "dtype": "float32", "shape": [3]}


@pytest.mark.parametrize(
    "content, match",
    [
        (b"", "the file is empty"),
        (b"solid cube", "expected a file written by `jaxsurf.save`, got another format"),
        (foreign_zip(), "got another zip archive"),
        (archive({"format": "other"}), "got another zip archive"),
        (archive([1]), "got another zip archive"),
        (archive("{"), "its description is damaged"),
        (archive("[" * 100_000), "its description is damaged"),
        (
            archive({"format": "jaxsurf", "version": 2, "tree": 1}),
            "has the format version 2, .* up to 1; upgrade jaxsurf",
        ),
        (archive({"format": "jaxsurf", "version": 0}), "has the format version 0"),
        (archive({"format": "jaxsurf", "version": 1}), "has no tree"),
        (
            tree({"class": "Unheard", "fields": {}}),
            "`shape` is of the class 'Unheard', which is not known here",
        ),
        (tree({"registered": "Unheard"}), "'Unheard', which is not known here"),
        (tree({"class": ["NativeNothing"], "fields": {}}), "the description of `shape` in it is damaged"),
        (
            tree({"class": "NativeCurve", "fields": {"degree": 3}}),
            "lacks the field 'control_points' .expected control_points, degree",
        ),
        (tree({"class": "NativeNothing", "fields": {"x": 3}}), "has the unknown field 'x' .expected none"),
        (tree({"class": "NativeNothing"}), "the description of `shape` in it is damaged"),
        (
            tree({"tuple": [{"what": 1}]}),
            r"the description of `shape\[0\]` in it is damaged or of an unknown kind",
        ),
        (tree(1.5), "the description of `shape` in it is damaged"),
        (tree({"float": "x"}), "the description of `shape` in it is damaged"),
        (tree({"list": 3}), "the description of `shape` in it is damaged"),
        (tree(ARRAY), "the array of `shape` is missing"),
        (tree(ARRAY, **{"0": b"x"}), "expected the array of `shape` in numpy's .npy layout"),
    ],
)
def test_what_cannot_be_loaded(path, content, match):
    path.write_bytes(content)
    with pytest.raises(InputError, match=match) as caught:
        load(path)
    assert str(caught.value).startswith("Cannot read ") and "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [{"dtype": "float16"}, {"shape": [4]}, {"kind": "other"}, {"dtype": "nonsense"}])
def test_arrays_that_are_not_as_described(path, change):
    content = io.BytesIO()
    np.save(content, np.ones(3, np.float32))
    path.write_bytes(tree({**ARRAY, **change}, **{"0": content.getvalue()}))
    with pytest.raises(InputError, match="the description of `shape` in it is damaged"):
        load(path)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load(tmp_path / "none.jxs")


def test_cut_and_damaged_files(path):
    save(path, NativePair(jnp.arange(6.0, dtype=jnp.float32), np.ones(4)))
    content, random = path.read_bytes(), np.random.default_rng(2)
    for cut in range(1, len(content)):
        path.write_bytes(content[:cut])
        with pytest.raises(InputError, match="cut or damaged|another format"):
            load(path)
    for _ in range(300):
        damaged = bytearray(content)
        damaged[random.integers(len(damaged))] ^= random.integers(1, 256)
        path.write_bytes(damaged)
        try:
            found = load(path)
        except InputError:
            continue
        assert found.first.tolist() == list(range(6)) and (found.second == 1).all()  # a byte that says nothing


KILLED = """
import os, signal, sys
import numpy as np
from jaxsurf.io._native import save

def write_half(file, array, **_):
    file.write(array.tobytes()[:40])
    os.kill(os.getpid(), signal.SIGKILL)

np.lib.format.write_array = write_half
save(sys.argv[1], np.zeros(100))
"""


def test_a_killed_process_leaves_the_old_file(path):
    save(path, [1, 2, 3])
    assert subprocess.run([sys.executable, "-c", KILLED, str(path)]).returncode == -signal.SIGKILL
    assert load(path) == [1, 2, 3]
    save(path, [4])
    assert load(path) == [4]
