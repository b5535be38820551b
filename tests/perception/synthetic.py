"""Height maps as a scan might give them: the true surface with noise and ragged edges."""

from __future__ import annotations

import numpy as np

from setae.config import load
from setae.heightmap import HeightMap
from setae.objects import ScanObject, random_object, table_scene
from setae.perception.measures import away_from_edges
from setae.perception.surface import height_mm

CONFIG = load()
REACH_MM = CONFIG.scan_reach_mm


def felt(
    what: ScanObject,
    *,
    seed: int = 0,
    step_mm: float = 10.0,
    noise_mm: float = 0.7,
    ragged: float = 0.5,
) -> HeightMap:
    """A map of an object: away from edges noise alone, at edges slips and misses."""
    rng = np.random.default_rng(seed)
    solids = table_scene(CONFIG, what).solids
    places = np.arange(0.0, 200.0 + step_mm / 2, step_mm)
    x, y = np.meshgrid(places, places)
    height = height_mm(solids, x, y)
    slipped = ~away_from_edges(solids, x, y) & (rng.random(x.shape) < ragged)
    # A bristle that slips is in contact beside where it was, and lower.
    aside = height_mm(
        solids, x + rng.uniform(-6, 6, x.shape), y + rng.uniform(-6, 6, x.shape)
    ) - rng.uniform(0, 3, x.shape)
    height = np.where(slipped, aside, height) + rng.normal(0, noise_mm, x.shape)
    there = height > REACH_MM
    mark = np.where(there, np.where(slipped, "slipped", "felt"), "empty")
    return HeightMap(x_mm=places, y_mm=places, height_mm=np.where(there, height, np.nan), mark=mark)


def trials(shape: str, seeds: range) -> list[HeightMap]:
    """Maps of random objects of one shape."""
    return [felt(random_object(shape, seed), seed=seed) for seed in seeds]
