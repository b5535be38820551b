"""The paper's way to compare trials: align, down-sample to 20 × 15, flatten, embed by t-SNE.

"The data were aligned by the contact point with the least X and Y values and down-sampled to
20×15 data points. Then the data were flattened and clustered using t-distributed stochastic
neighbor embedding." What it doesn't say is taken as follows. The origin is the least x and the
least y that was touched. The 20 × 15 points lie 10 mm apart, the paper's own step, 20 along x and
15 along y: so sizes stay, and what reaches farther is cut off. A point holds the height above
what the extended tip reaches, and 0 where nothing was touched.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Final

import numpy as np

from setae import extras
from setae.arc import FloatArray
from setae.errors import InputError
from setae.heightmap import HeightMap
from setae.perception import maps

__all__ = ["CELL_MM", "COLUMNS", "PERPLEXITY", "ROWS", "embedded", "normalised", "silhouette"]

COLUMNS: Final = 20
ROWS: Final = 15
CELL_MM: Final = 10.0
PERPLEXITY: Final = 4.0
"""About how many neighbours a trial has: the others of its object, of five."""


def normalised(heights: HeightMap, *, reach_mm: float) -> FloatArray:
    """Return the paper's normalised data of one trial, flattened row by row, (300,).

    Parameters
    ----------
    heights
        The scan.
    reach_mm
        z of the world that the fully extended tip reaches: the heights' zero.

    Raises
    ------
    InputError
        Nothing was touched.
    """
    points = maps.known(heights)
    if not len(points):
        raise InputError("The scan touched nothing.", "Scan an object within the robot's reach.")
    column = np.round((points[:, 0] - points[:, 0].min()) / CELL_MM).astype(int)
    row = np.round((points[:, 1] - points[:, 1].min()) / CELL_MM).astype(int)
    inside = (column < COLUMNS) & (row < ROWS)
    total, count = np.zeros((ROWS, COLUMNS)), np.zeros((ROWS, COLUMNS))
    np.add.at(total, (row[inside], column[inside]), points[inside, 2] - reach_mm)
    np.add.at(count, (row[inside], column[inside]), 1.0)
    return np.asarray(total / np.maximum(count, 1.0)).ravel()


def embedded(vectors: FloatArray, *, seed: int = 0) -> FloatArray:
    """Embed vectors (n, d) into a plane by t-SNE, (n, 2): the same again for the same seed.

    Raises
    ------
    InputError
        There are fewer than three.
    ExtraMissingError
        scikit-learn isn't installed.
    """
    count = len(vectors)
    if count < 3:
        raise InputError(
            f"{count} scans make no picture of clusters.", "Give three or more, better 25."
        )
    manifold = extras.load("sklearn.manifold", "perception", "t-SNE")
    threads = extras.load("threadpoolctl", "perception", "t-SNE")
    # More threads than one only wait for each other: 25 vectors take 0.1 s with one, 8 s with many.
    with threads.threadpool_limits(1), warnings.catch_warnings():
        # Equal vectors have no variance along the axes from which t-SNE starts.
        warnings.simplefilter("ignore", RuntimeWarning)
        plane = manifold.TSNE(
            n_components=2,
            perplexity=min(PERPLEXITY, (count - 1) / 2),
            init="pca",
            random_state=seed,
            n_jobs=1,
        ).fit_transform(np.asarray(vectors, dtype=np.float64))
    return np.asarray(plane, dtype=np.float64)


def silhouette(vectors: FloatArray, labels: Sequence[str]) -> float:
    """Mean silhouette of labelled vectors (n, d): 1 is far apart, 0 is mixed.

    Rousseeuw's (Journal of Computational and Applied Mathematics 20, 1987): for each vector the
    mean distance b to the nearest other label's, less the mean distance a to its own, over the
    larger of the two. One that is alone counts 0. NaN where there is only one label.
    """
    vectors, names = np.asarray(vectors, dtype=np.float64), np.asarray(labels)
    kinds = np.unique(names)
    if len(kinds) < 2:
        return float("nan")
    distance = np.linalg.norm(vectors[:, np.newaxis] - vectors, axis=-1)
    to_kind = np.stack([distance[:, names == kind].sum(axis=1) for kind in kinds], axis=1)
    count = np.array([(names == kind).sum() for kind in kinds])
    own = names[:, np.newaxis] == kinds
    a = to_kind[own] / np.maximum(count[own.argmax(axis=1)] - 1, 1)
    b = np.where(own, np.inf, to_kind / count).min(axis=1)
    alone = count[own.argmax(axis=1)] == 1
    value = (b - a) / np.maximum(np.maximum(a, b), np.finfo(float).tiny)
    return float(np.where(alone, 0.0, value).mean())
