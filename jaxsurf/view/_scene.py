"""What a picture shows, ready for either program that draws."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

Colour = tuple[float, float, float]

# Light and cool in front, sand behind: which side is seen is then never a question.
FRONT: tuple[Colour, ...] = (
    (0.56, 0.67, 0.80),
    (0.62, 0.76, 0.64),
    (0.82, 0.64, 0.67),
    (0.70, 0.64, 0.80),
    (0.55, 0.75, 0.77),
    (0.68, 0.71, 0.74),
)
BACK: Colour = (0.80, 0.72, 0.58)
EDGE: Colour = (0.13, 0.17, 0.23)
GREY: Colour = (0.62, 0.64, 0.66)
STROKE: tuple[Colour, ...] = ((0.10, 0.35, 0.65), (0.75, 0.25, 0.15), (0.15, 0.50, 0.30), (0.45, 0.25, 0.60))
SKY: tuple[Colour, Colour] = ((1.0, 1.0, 1.0), (0.905, 0.92, 0.94))  # top, bottom
PAPER: tuple[Colour, Colour] = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))


# Light from two far lamps fixed to the eye (right, up, toward it), and from everywhere.
KEY = np.array([-0.62, 0.58, 0.53])
FILL = np.array([0.55, -0.10, 0.83])


@dataclass(frozen=True)
class Light:
    """Strengths: of light from everywhere, of the two lamps, and of the highlight."""

    ambient: float
    key: float
    fill: float
    shine: float


MODELLING = Light(0.32, 0.66, 0.28, 0.16)
READING = Light(0.70, 0.24, 0.12, 0.0)  # colours that stand for values must be recognised on the bar


@dataclass(frozen=True)
class Facets:
    """Triangles in one colour, or coloured by `values` at the vertices (NaN: no value, grey)."""

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "n 3"]
    colour: Colour = FRONT[0]
    values: Float[np.ndarray, "n"] | None = None

    @property
    def light(self) -> Light:
        """Even light for colours that are to be read, strong light for those that show a form."""
        return MODELLING if self.values is None else READING


@dataclass(frozen=True)
class Strokes:
    """Polylines; `width` in pixels of a picture 1200 wide, `strength` from 0 (nothing) to 1 (opaque)."""

    lines: tuple[Float[np.ndarray, "_ 3"], ...]
    colour: Colour = EDGE
    width: float = 1.6
    strength: float = 1.0


@dataclass(frozen=True)
class Dots:
    """Points in one colour or coloured by `values`; `size` is a diameter in pixels of a picture 1200 wide."""

    points: Float[np.ndarray, "n 3"]
    colour: Colour = EDGE
    values: Float[np.ndarray, "n"] | None = None
    size: float = 3.0


def stroke_scale(width: int) -> float:
    """Pixels of a picture `width` wide for one of a picture 1200 wide; small ones keep strokes visible."""
    return (width / 1200) ** (1.0 if width > 1200 else 0.5)


@dataclass(frozen=True)
class Scene:
    """Everything in one picture.

    `table`: (256, 3) colours that stand for values from `limits[0]` to `limits[1]`;
    `sky`: the colours behind everything, top and bottom.
    """

    facets: tuple[Facets, ...] = ()
    strokes: tuple[Strokes, ...] = ()
    dots: tuple[Dots, ...] = ()
    limits: tuple[float, float] = (0.0, 1.0)
    table: Float[np.ndarray, "256 3"] = field(default_factory=lambda: np.zeros((256, 3)))
    sky: tuple[Colour, Colour] = SKY

    def all_points(self) -> Float[np.ndarray, "n 3"]:
        """Every point that the picture must hold."""
        lines = [line for strokes in self.strokes for line in strokes.lines]
        parts = [f.vertices for f in self.facets] + lines + [d.points for d in self.dots]
        return np.concatenate(parts) if parts else np.zeros((0, 3))

    def colours_of(self, values: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Colours of values: clipped to the limits, grey where NaN."""
        low, high = self.limits
        place = np.clip((values - low) / ((high - low) or 1.0), 0.0, 1.0)
        known = np.isfinite(place)
        return np.where(known[:, None], self.table[(np.where(known, place, 0.0) * 255).round().astype(int)], GREY)
