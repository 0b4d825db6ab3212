from ._points import read_points as read_points
from ._mesh import write_mesh as write_mesh
from ._native import load as load, save as save
