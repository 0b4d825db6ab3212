"""The house: rooms import only from lower floors, in one way, and guards live in one place."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "jaxsurf"

GROUND = "the ground files"
FLOORS = (
    (GROUND,),
    ("basis",),
    ("quaternion",),
    ("curve",),
    ("surface",),
    ("edit",),
    ("differential",),
    ("io", "convert", "mesh"),
    ("query",),
    ("build",),
    ("audit", "machining"),
    ("fit",),
    ("optimise", "studio", "view"),
    ("report",),
    ("gallery",),
    ("cli",),
    ("the package's own files",),
)
FLOOR = {room: i for i, rooms in enumerate(FLOORS) for room in rooms}
FILES = sorted(PACKAGE.rglob("*.py"))
ids = lambda path: str(path.relative_to(PACKAGE))


def test_every_room_has_a_floor():
    assert {_room(path) for path in FILES} <= set(FLOOR)


@pytest.mark.parametrize("path", FILES, ids=ids)
def test_rooms_import_only_from_lower_floors(path):
    room = _room(path)
    for target in _imports(path):
        other = _room(target)
        assert other == room or FLOOR[other] < FLOOR[room], f"{ids(path)} imports {ids(target)}"


def test_no_circles():
    graph = {path: _imports(path) for path in FILES if path.name != "__init__.py"}
    done, above = set(), []

    def visit(path):
        assert path not in above, " -> ".join(ids(p) for p in [*above[above.index(path) :], path])
        if path in done or path not in graph:
            return
        above.append(path)
        for target in graph[path]:
            visit(target)
        done.add(above.pop())

    for path in graph:
        visit(path)


@pytest.mark.parametrize("path", [p for p in FILES if p.name == "__init__.py"], ids=ids)
def test_init_files_only_pass_names_on(path):
    for statement in _tree(path).body:
        if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            continue  # a docstring
        if path.parent == PACKAGE and isinstance(statement, ast.Assign):
            assert ast.unparse(statement.targets[0]) == "__version__"
            continue
        assert isinstance(statement, ast.ImportFrom), ast.unparse(statement)
        assert statement.level == 1, ast.unparse(statement)
        for name in statement.names:
            assert name.asname == name.name, ast.unparse(statement)


@pytest.mark.parametrize("path", FILES, ids=ids)
def test_files_are_short_and_called_by_what_is_in_them(path):
    assert len(path.read_text().splitlines()) <= 400
    assert not re.search(r"misc|util|helper|common", path.stem)


@pytest.mark.parametrize("path", FILES, ids=ids)
def test_guards_live_in_one_file(path):
    """Of code under differentiation: host code on concrete data, written with numpy as `np`, needs none."""
    if path.name == "_safe.py":
        return
    for node in ast.walk(_tree(path)):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        assert not re.search(r"(^|\.)(arccos|arcsin|acos|asin)$", called) or called.startswith(("np.", "math.")), (
            f"line {node.lineno}: {called}"
        )
        assert not re.fullmatch(r"(jnp|jax\.numpy)\.linalg\.norm", called), f"line {node.lineno}: {called}"
        if called in ("jnp.where", "jax.numpy.where"):
            assert not _guards_from_zero(*node.args), f"line {node.lineno}: {ast.unparse(node)}"


def _guards_from_zero(condition: ast.expr, *branches: ast.expr) -> bool:
    """Whether a condition compares with 0 what one of the branches then uses."""
    used = {ast.unparse(node) for branch in branches for node in ast.walk(branch)}
    for node in ast.walk(condition):
        if isinstance(node, ast.Compare) and any(isinstance(op, ast.Eq | ast.NotEq) for op in node.ops):
            sides = (node.left, *node.comparators)
            zero = any(isinstance(side, ast.Constant) and side.value == 0 for side in sides)
            if zero and any(ast.unparse(side) in used - {"0"} for side in sides):
                return True
    return False


def _room(path: Path) -> str:
    parts = path.relative_to(PACKAGE).parts
    if len(parts) > 1:
        return parts[0]
    return "the package's own files" if path.stem in ("__init__", "__main__") else GROUND


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def _imports(path: Path) -> list[Path]:
    """The files of the package that a file imports, inside functions too, but for type checking."""
    found = []
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            modules = [PACKAGE.parent.joinpath(*name.name.split(".")) for name in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = path.parents[node.level - 1] if node.level else PACKAGE.parent
            module = start.joinpath(*(node.module or "").split(".")) if node.module else start
            # `from ._x import name` means the file _x; `from . import room` means the room
            modules = [module / name.name if _file(module / name.name) else module for name in node.names]
        else:
            continue
        found += [file for module in modules if (file := _file(module)) and PACKAGE in file.parents]
    return found


def _file(module: Path) -> Path | None:
    """The file of a module, given as a path without suffix."""
    for candidate in (module.with_suffix(".py"), module / "__init__.py"):
        if candidate.exists():
            return candidate
    return None
