"""The main job's file: a measured scan, fitted, in a STEP file that readers other than ours open."""

from pathlib import Path

import gmsh
import numpy as np
import pytest
import step_parser

import jaxsurf as js

SCAN = Path(__file__).parent.parent / "data" / "bunny_ear.ply"
PLACES = np.random.default_rng(5).uniform(0, 1, (50, 2))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """The fitted surface and its file."""
    path = tmp_path_factory.mktemp("scan") / "ear.step"
    shape = js.fit_cloud(js.io.read_points(SCAN), spans=(8, 4)).shape
    js.io.write_step(path, shape, unit="mm")
    return shape, path


def test_gmsh_gives_the_same_points(fitted):
    shape, path = fitted
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        ((_, face),) = [tag for tag in gmsh.model.occ.importShapes(str(path)) if tag[0] == 2]
        gmsh.model.occ.synchronize()
        found = np.reshape(gmsh.model.getValue(2, face, PLACES.ravel()), (-1, 3))
    finally:
        gmsh.finalize()
    np.testing.assert_allclose(found, shape(*PLACES.T), rtol=0, atol=1e-6)


def test_a_parser_of_our_own_and_scipy_give_the_same_points(fitted):
    shape, path = fitted
    (surface,) = step_parser.surfaces(path)
    found = np.stack([surface(u, v) for u, v in PLACES])
    np.testing.assert_allclose(found, shape(*PLACES.T), rtol=0, atol=1e-6)


def test_reading_back_gives_the_surface_bit_for_bit(fitted):
    shape, path = fitted
    (read,) = js.io.read_step(path)
    np.testing.assert_array_equal(read.control_points, shape.control_points)
