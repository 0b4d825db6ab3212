from ._iges import write_iges as write_iges
from ._mesh import write_mesh as write_mesh
from ._native import load as load, save as save
from ._points import read_points as read_points
from ._rhino import write_3dm as write_3dm
from ._step import read_step as read_step, step_unit as step_unit, write_step as write_step
from ._units import check_unit as check_unit
