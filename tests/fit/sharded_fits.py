"""Fits of points spread over four devices, for test_shards.py, which runs this in a process of its own."""

import sys

import jax
import numpy as np
from fit_cases import dented, points_on, sheet
from jax.sharding import Mesh, NamedSharding, PartitionSpec

import jaxsurf as js
from jaxsurf.fit import shard_points

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

TRUTH = sheet()
POINTS = points_on(TRUTH, 602, seed=1)
POINTS = POINTS + 0.02 * np.random.default_rng(3).normal(size=POINTS.shape)
POINTS[::9, 2] += 0.5
START = dented(TRUTH, 3)
WEIGHTS = np.random.default_rng(5).uniform(0.5, 2, len(POINTS))


def spread(points, count):
    return points if count == 0 else shard_points(points, devices=jax.devices()[:count])


def figures(found):
    deviation = found.deviation
    return [deviation.rms, deviation.max, deviation.mean, *deviation.quantiles.values()]


def main(path: str) -> None:
    results = {}
    # Stiff: of a net that nothing but noise holds, the order of the points alone moves control points by 1e-7.
    options = {"loss": "huber", "bending": 1e-5, "weights": WEIGHTS, "progress": lambda event: False}
    for count in (0, 4):
        found = js.fit(START, spread(POINTS, count), **options)
        results[f"robust {count}"] = found.shape.control_points
        results[f"feet {count}"] = found.foot.parameters
        results[f"figures {count}"] = np.asarray(figures(found))
    for count in (0, 4):
        cloud = js.fit_cloud(spread(POINTS, count), spans=(3, 2), tolerance=0.06, max_spans=5, holdout=0.2)
        results[f"cloud {count}"] = cloud.shape.control_points
        assert cloud.holdout is not None
        results[f"left out {count}"] = cloud.holdout.rms
    mesh = Mesh(np.asarray(jax.devices()[:2]), ("any name",))
    placed = jax.device_put(POINTS, NamedSharding(mesh, PartitionSpec("any name")))
    results["placed"] = js.fit(START, placed, **options).shape.control_points
    square = Mesh(np.asarray(jax.devices()).reshape(2, 2), ("a", "b"))
    try:
        js.fit(START, jax.device_put(POINTS, NamedSharding(square, PartitionSpec("a"))))
    except js.InputError as error:
        results["refusal"] = str(error)
    np.savez(path, allow_pickle=False, **{name: np.asarray(value) for name, value in results.items()})


if __name__ == "__main__":
    main(sys.argv[1])
