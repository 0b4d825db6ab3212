"""Which program draws: pyvista where this machine can render, else this package's own painter."""

import contextlib
import functools
import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterator
from typing import Literal

from .._errors import InputError, MissingPackageError, import_optional

Backend = str  # one of "auto", "pyvista", "matplotlib"; checked at the door
BACKENDS = ("auto", "pyvista", "matplotlib")
WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
NATIVE = ""  # the window class that VTK takes by itself

# VTK without a working OpenGL ends the process by a segmentation fault, so the question is put to another
# process.
PROBE = """
import sys
import vtkmodules.vtkRenderingOpenGL2 as opengl
window = getattr(opengl, sys.argv[1])()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.Render()
sys.exit(0 if window.SupportsOpenGL() else 1)
"""
PROBE_SECONDS = 60


def choose_backend(backend: str) -> Literal["pyvista", "matplotlib"]:
    """The program that will draw. Raises `InputError` on unknown names and if pyvista cannot render here."""
    if backend not in BACKENDS:
        raise InputError(f"`backend` must be one of {', '.join(BACKENDS)}, got {backend!r}.")
    if backend == "matplotlib":
        import_optional("matplotlib", extra="plot", purpose="pictures")
        return "matplotlib"
    if backend == "pyvista":
        import_optional("pyvista", extra="render", purpose="shaded pictures")
        if opengl_window() is None:
            raise InputError(
                "pyvista cannot render on this machine: it has no OpenGL. Install Mesa's libraries "
                "(on Debian and Ubuntu `apt-get install libegl1 libgl1-mesa-dri`) "
                'or pass backend="matplotlib".'
            )
        return "pyvista"
    if _is_installed("pyvista") and opengl_window() is not None:
        return "pyvista"
    if _is_installed("matplotlib"):
        return "matplotlib"
    raise MissingPackageError(
        "Pictures need the package `matplotlib`, or `pyvista` for better ones, and neither can be imported: "
        "install one with `pip install 'jaxsurf[plot]'` or `pip install 'jaxsurf[render]'`."
    )


def opengl_window() -> str | None:
    """The VTK window class that renders off screen here; `""`: VTK's own choice; `None`: none.

    The first call starts a process for half a second; later calls remember its answer.
    """
    if not sys.platform.startswith("linux"):
        return NATIVE
    wished = os.environ.get(WINDOW_VARIABLE)
    if wished:
        return wished if _renders(wished) else None
    windows = ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    if os.environ.get("DISPLAY"):
        windows.append("vtkXOpenGLRenderWindow")
    return next(filter(_renders, windows), None)


@contextlib.contextmanager
def opengl_window_chosen() -> Iterator[None]:
    """Windows made inside the block are of the class found; outside, the environment is the user's own."""
    window = opengl_window()
    if not window or os.environ.get(WINDOW_VARIABLE):
        yield
        return
    os.environ[WINDOW_VARIABLE] = window
    try:
        yield
    finally:
        del os.environ[WINDOW_VARIABLE]


@functools.cache
def _renders(window: str) -> bool:
    command = [sys.executable, "-c", PROBE, window]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PROBE_SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def _is_installed(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ValueError:
        return False
