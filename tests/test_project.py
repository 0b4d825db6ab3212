"""The project: one version, a changelog, docstrings, and a light import."""

import inspect
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import jaxsurf as js

ROOT = Path(__file__).parent.parent
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
PUBLIC = {name: getattr(js, name) for name in dir(js) if name[0] != "_" and name != "jaxtyping"}
ROOMS = {name: value for name, value in PUBLIC.items() if inspect.ismodule(value) and value.__name__.startswith("jaxsurf.")}


def test_the_version_is_in_one_place():
    texts = [path.read_text() for path in (ROOT / "jaxsurf").rglob("*.py")]
    assert not any(f'"{VERSION}"' in text for text in texts)


def test_the_changelog_has_a_heading_for_the_version():
    headings = re.findall(r"^## (\S+) — (\S+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[0][0] == VERSION
    assert re.fullmatch(r"\d{4}-\d{2}-\d{2}|unreleased", headings[0][1])


@pytest.mark.parametrize("name", sorted(set(PUBLIC) - set(ROOMS)))
def test_public_names_have_docstrings(name):
    value = PUBLIC[name]
    if not (inspect.isclass(value) or callable(value)):
        return
    # a class must have its own: `inspect.getdoc` would find that of a base class
    assert vars(value).get("__doc__") if inspect.isclass(value) else value.__doc__, name
    if inspect.isclass(value) and value.__module__.startswith("jaxsurf"):
        for method, member in vars(value).items():
            if not method.startswith("_") and (inspect.isfunction(member) or isinstance(member, property)):
                assert inspect.getdoc(getattr(value, method)), f"{name}.{method}"


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_public_rooms_have_docstrings(room):
    for name, value in vars(ROOMS[room]).items():
        if not name.startswith("_") and (inspect.isclass(value) or inspect.isfunction(value)):
            assert inspect.getdoc(value), f"js.{room}.{name}"


def test_importing_loads_no_optional_package():
    heavy = {"OCP", "rhino3dm", "pyvista", "vtk", "matplotlib", "trimesh", "laspy", "pye57", "pypcd4", "tqdm"}
    code = f"import sys, jaxsurf; print(sorted({heavy!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_importing_does_not_touch_the_precision():
    code = "import jax, jaxsurf; print(jax.config.jax_enable_x64)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
