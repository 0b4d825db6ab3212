"""Guides and characters of a bumpy sheet, for the tests of networks."""

import numpy as np

import jaxsurf as js


def height(x, y):
    return 0.4 * np.sin(2.1 * x + 0.3) * np.cos(1.7 * y + 0.5) + 0.1 * x * y


def isoline(fixed, along, low=0.0, high=1.0, lift=0.0, count=12):
    """The curve of the sheet at one x ("y" runs) or at one y ("x" runs), through points of it."""
    t, constant = np.linspace(low, high, count), np.full(count, fixed)
    x, y = (constant, t) if along == "y" else (t, constant)
    return js.interpolate(np.stack([x, y, height(x, y) + lift], axis=1))


def guide(x, low=0.0, high=1.0, lift=0.0):
    return isoline(x, "y", low, high, lift)


def character(y, low=0.0, high=1.0, lift=0.0):
    return isoline(y, "x", low, high, lift)


def straight(start, end):
    """A line as a spline of the same structure."""
    return js.interpolate(np.linspace(start, end, 12))


def sheet(guides, characters, **options):
    """A full network."""
    return js.network(
        [guide(x) for x in np.linspace(0, 1, guides)],
        [character(y) for y in np.linspace(0, 1, characters)],
        **{"tolerance": 1e-3, **options},
    )


def star(kinds, seed, bend=0.3):
    """A node with spokes of random curvature all round, "g" of guides and "c" of characters, in patches that are random too:
    triangles between spokes of one kind, else quads. The tangents of all curves at a node lie in one plane."""
    rng, m = np.random.default_rng(seed), len(kinds)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    angles = 2 * np.pi * (np.arange(m) + rng.uniform(-0.25, 0.25, m)) / m
    spokes = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    ends = spokes + bend * rng.normal(size=(m, 1)) * [0, 0, 1]
    out = ends * np.stack([np.ones(m), np.ones(m), rng.uniform(0.5, 1.5, m)], axis=1) + 0.1 * rng.normal(size=(m, 3))
    beside = np.stack([-np.sin(angles), np.cos(angles), bend * rng.normal(size=m)], axis=1)
    curves = {"g": [], "c": []}
    put = lambda kind, *points: curves[kind].append(js.BSplineCurve(np.stack(points) @ turn.T, js.clamped_knots(4, 3), 3))
    for i in range(m):
        j = (i + 1) % m
        put(kinds[i], np.zeros(3), 0.33 * spokes[i], ends[i] - 0.33 * out[i], ends[i])
        if kinds[i] == kinds[j]:
            put("gc"[kinds[i] == "g"], ends[i], ends[i] + 0.3 * beside[i], ends[j] - 0.3 * beside[j], ends[j])
            continue
        tip = 1.3 * (spokes[i] + spokes[j]) / np.linalg.norm(spokes[i] + spokes[j]) + [0, 0, bend * rng.normal()]
        for k, way, kind in ((i, 1, kinds[j]), (j, -1, kinds[i])):
            near_tip = tip + 0.3 * (ends[k] - tip) + 0.05 * rng.normal(size=3)
            put(kind, ends[k], ends[k] + 0.25 * (out[k] + way * beside[k]), near_tip, tip)
    return js.network(curves["g"], curves["c"], tolerance=1e-3)


def along_side(place, part, shares):
    """Parameters u, v on a part of a side of a patch."""
    _, side = place
    run = part[0] + (part[1] - part[0]) * shares
    fixed = np.full_like(run, float(side[1]))
    return (fixed, run) if side[0] == "u" else (run, fixed)


def largest_gap_of_edges(network, count=7):
    """Of all inner edges: the largest distance between the two patches at the same share."""
    patches, shares, largest = network.patches, np.linspace(0, 1, count), 0.0
    for edge in network.inner_edges():
        sides = ((edge.first, edge.first_part), (edge.second, edge.second_part))
        one, other = (np.asarray(patches[s[0]](*along_side(s, part, shares))) for s, part in sides)
        largest = max(largest, float(np.abs(one - other).max()))
    return largest


def side_of(grid, side):
    """The points of a patch on one side, of its grid."""
    return {"u0": grid[0], "u1": grid[-1], "v0": grid[:, 0], "v1": grid[:, -1]}[side]


def largest_gap_on(grid, network):
    """The same of the grids of all patches, for networks whose edges are whole sides."""
    largest = 0.0
    for edge in network.inner_edges():
        one, other = (side_of(grid[patch], side) for patch, side in (edge.first, edge.second))
        largest = max(largest, float(np.abs(one - (other[::-1] if edge.reversed else other)).max()))
    return largest
