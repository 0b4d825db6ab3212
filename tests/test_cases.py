"""The table of cases is complete."""

import importlib
import pkgutil

from cases import CURVES, SURFACES, make

import jaxsurf
from jaxsurf._registry import registered_class, registered_names
from jaxsurf.curve import AbstractCurve
from jaxsurf.surface import AbstractSurface


def test_every_registered_shape_has_a_case():
    for module in pkgutil.walk_packages(jaxsurf.__path__, "jaxsurf."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    classes = [registered_class(name) for name in registered_names()]
    own = {c for c in classes if c is not None and c.__module__.startswith("jaxsurf.")}
    for table, kind in ((CURVES, AbstractCurve), (SURFACES, AbstractSurface)):
        assert {c for c in own if issubclass(c, kind)} == {type(make(name).shape) for name in table}
