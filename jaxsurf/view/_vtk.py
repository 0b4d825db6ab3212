"""A scene to an array of pixels by pyvista."""

import numpy as np
from jaxtyping import Float, UInt8

from .._errors import import_optional
from ._backend import opengl_window_chosen
from ._camera import Camera
from ._paint import SAMPLES, reduced
from ._scene import BACK, FILL, GREY, KEY, MODELLING, Scene, stroke_scale

NEARER = 0.004  # of the picture's depth: strokes and dots are drawn this much before the surface they lie on


def render(scene: Scene, camera: Camera, size: tuple[int, int]) -> UInt8[np.ndarray, "h w 3"]:
    """The scene as an (h, w, 3) picture; `size` = (w, h)."""
    pyvista = import_optional("pyvista", extra="render", purpose="shaded pictures")
    with opengl_window_chosen():
        window = [size[0] * SAMPLES, size[1] * SAMPLES]
        plotter = pyvista.Plotter(off_screen=True, window_size=window, lighting="none")
        try:
            _fill(pyvista, plotter, scene, camera, SAMPLES * stroke_scale(size[0]))
            _aim(plotter, camera)
            pixels = np.asarray(plotter.screenshot(return_img=True))[..., :3]
        finally:
            plotter.close()
    return reduced(pixels.astype(np.float32))


def _fill(pyvista, plotter, scene: Scene, camera: Camera, brush: float) -> None:
    plotter.set_background(scene.sky[1], top=scene.sky[0])
    for direction, strength in ((KEY, MODELLING.key), (FILL, MODELLING.fill)):
        # Parallel light, fixed to the eye.
        plotter.add_light(pyvista.Light(position=direction @ camera.axes, intensity=strength, light_type="scene light"))
    toward = camera.axes[2] * NEARER * camera.half_depth
    mapped = {"cmap": _colour_map(scene), "clim": scene.limits, "nan_color": GREY, "show_scalar_bar": False}
    for facets in scene.facets:
        mesh = pyvista.PolyData.from_regular_faces(facets.vertices, facets.faces)
        mesh.point_data.active_normals = facets.normals
        light = facets.light
        look = {"ambient": light.ambient, "diffuse": light.key / MODELLING.key, "specular": light.shine}
        if facets.values is None:
            colours = {"color": facets.colour, "backface_params": {"color": BACK, **look}}
        else:
            mesh.point_data["value"] = facets.values
            colours = {"scalars": "value", **mapped}
        actor = plotter.add_mesh(mesh, smooth_shading=False, specular_power=40.0, **look, **colours)
        actor.prop.interpolation = "Phong"
    for strokes in scene.strokes:
        if strokes.lines:
            look = {"color": strokes.colour, "line_width": strokes.width * brush, "opacity": strokes.strength}
            plotter.add_mesh(_polylines(pyvista, strokes.lines, toward), lighting=False, **look)
    for dots in scene.dots:
        cloud = pyvista.PolyData(dots.points + toward)
        look = {"point_size": dots.size * brush, "render_points_as_spheres": True, "lighting": False}
        if dots.values is None:
            plotter.add_mesh(cloud, color=dots.colour, style="points", **look)
        else:
            cloud.point_data["value"] = dots.values
            plotter.add_mesh(cloud, scalars="value", style="points", **look, **mapped)


def _aim(plotter, camera: Camera) -> None:
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = camera.centre
    plotter.camera.position = camera.centre + camera.axes[2] * 4 * camera.half_depth
    plotter.camera.up = camera.axes[1]
    plotter.camera.parallel_scale = camera.half_height
    plotter.renderer.ResetCameraClippingRange()


def _polylines(pyvista, lines: tuple[Float[np.ndarray, "_ 3"], ...], shift: np.ndarray):
    starts = np.cumsum([0, *(len(line) for line in lines)])
    cells = [np.r_[len(line), start + np.arange(len(line))] for line, start in zip(lines, starts, strict=False)]
    return pyvista.PolyData(np.concatenate(lines) + shift, lines=np.concatenate(cells))


def _colour_map(scene: Scene):
    colors = import_optional("matplotlib.colors", extra="plot", purpose="pictures")
    return colors.ListedColormap(scene.table)
