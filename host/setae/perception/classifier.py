"""Which known shape a scan is of, how sure that is, and when it is none of them.

Scans of one shape are taken as normal about the shape's mean, with one covariance for all shapes.
Means and covariance are estimated from few scans, so a new scan's distance follows Student's, and
not the normal distribution (Geisser, Annals of Mathematical Statistics 35, 1964): Hotelling's T².
It gives both answers. Of the known shapes, the one with the largest predictive density. And where
even the best shape would give a scan as far out as this one less often than once in a hundred
times, the shape is unknown.

The densities alone would always be sure: between shapes so far apart one is always a million times
the other. So confidence is learned from how the scans are named by models of the others. Shares
are those of the densities to a power, the same for all (temperature scaling: Guo et al., ICML
2017), under which these answers are likeliest, where of n scans that are named right one in n + 2
counts as wrong (Platt, Advances in Large Margin Classifiers, 1999). So few scans allow no more.

The covariance starts from what scans are expected to differ by (`Feature.spread`), weighted as
`PRIOR_SCANS` scans: one scan of each shape will do for a start.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from setae import extras
from setae.arc import FloatArray
from setae.errors import InputError
from setae.perception.features import FEATURES

__all__ = [
    "PRIOR_SCANS",
    "RAREST",
    "Answer",
    "Model",
    "leave_one_out",
    "leave_shape_out",
    "load",
    "save",
    "train",
]

PRIOR_SCANS: Final = 8
RAREST: Final = 0.01
"""A known shape gives an answer of unknown so often."""

_KIND: Final = "setae shapes"
_VERSION: Final = 2
_HALVINGS: Final = 40


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Model:
    """What is known of some shapes.

    Parameters
    ----------
    shapes
        Their names, (k,).
    scans
        How many scans of each, (k,).
    means
        Mean description of each, (k, f).
    covariance
        Of scans of one shape, (f, f).
    freedom
        Its degrees of freedom.
    sharpness
        Power of the densities whose shares are the confidence, 0 to 1.

    Raises
    ------
    InputError
        The numbers don't fit together.
    """

    shapes: tuple[str, ...]
    scans: tuple[int, ...]
    means: FloatArray
    covariance: FloatArray
    freedom: float
    sharpness: float = 1.0

    def __post_init__(self) -> None:
        size = len(FEATURES)
        means = np.asarray(self.means, dtype=np.float64)
        covariance = np.asarray(self.covariance, dtype=np.float64)
        problem = ""
        if not self.shapes or len(set(self.shapes)) != len(self.shapes):
            problem = "it has no shapes, or one twice"
        elif means.shape != (len(self.shapes), size) or covariance.shape != (size, size):
            problem = f"its arrays aren't for {len(self.shapes)} shapes and {size} features"
        elif len(self.scans) != len(self.shapes) or min(self.scans) < 1:
            problem = "a shape has no scans"
        elif not (np.isfinite(means).all() and np.isfinite(covariance).all()):
            problem = "a number isn't finite"
        elif not np.allclose(covariance, covariance.T) or np.linalg.eigvalsh(covariance)[0] <= 0:
            problem = "its covariance is none"
        elif not (math.isfinite(self.freedom) and self.freedom >= size):
            problem = "its degrees of freedom are too few"
        elif not 0 <= self.sharpness <= 1:
            problem = "its sharpness isn't from 0 to 1"
        if problem:
            raise InputError(f"model of shapes: {problem}.", "Train it again.")
        object.__setattr__(self, "means", means)
        object.__setattr__(self, "covariance", covariance)

    def answer(self, vector: FloatArray) -> Answer:
        """Say which shape a description (f,) is of.

        Raises
        ------
        InputError
            It isn't a description.
        ExtraMissingError
            SciPy isn't installed.
        """
        vector = np.asarray(vector, dtype=np.float64)
        if vector.shape != (len(FEATURES),) or not np.isfinite(vector).all():
            raise InputError(f"A description has {len(FEATURES)} finite numbers.")
        special = extras.load("scipy.special", "perception", "Telling shapes apart")
        t2, log_density = self._distances(vector)
        size, free = len(FEATURES), self.freedom
        share = _shares(log_density, self.sharpness)
        fit = special.fdtrc(size, free - size + 1, t2 * (free - size + 1) / (size * free))
        best = int(np.argmax(log_density))
        return Answer(
            nearest=self.shapes[best],
            confidence=float(share[best]),
            fit=float(fit[best]),
            known=bool(fit[best] >= RAREST),
            shares={name: float(value) for name, value in zip(self.shapes, share, strict=True)},
        )

    def _distances(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Hotelling's T² to each shape, and the logarithm of its predictive density, (k,)."""
        away = vector - self.means
        count = np.array(self.scans, dtype=float)
        # The mean itself is uncertain: the fewer scans, the more.
        t2 = np.einsum("ki,ij,kj->k", away, np.linalg.inv(self.covariance), away)
        t2 = t2 * count / (count + 1)
        size, free = len(FEATURES), self.freedom
        return t2, -(free + 1) / 2 * np.log1p(t2 / free) + size / 2 * np.log(count / (count + 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a scan shows.

    Attributes
    ----------
    nearest
        The known shape that it is likest.
    confidence
        How sure that is among the known shapes, 0 to 1; of a scan that is none of them it says
        nothing.
    fit
        Of that shape's scans, what part lies as far out as this one or farther.
    known
        Whether that is at least `RAREST`; if not, it is none of the known shapes.
    shares
        Confidence in each.
    """

    nearest: str
    confidence: float
    fit: float
    known: bool
    shares: Mapping[str, float]

    @property
    def shape(self) -> str | None:
        """The shape's name; None: unknown."""
        return self.nearest if self.known else None


def train(vectors: FloatArray, labels: Sequence[str]) -> Model:
    """Learn shapes from descriptions.

    Parameters
    ----------
    vectors
        (n, f).
    labels
        Name of each one's shape, (n,).

    Raises
    ------
    InputError
        There are none, or their numbers differ.
    """
    vectors = np.asarray(vectors, dtype=np.float64)
    if vectors.ndim != 2 or len(vectors) != len(labels) or not len(labels):
        raise InputError("Training needs scans, and a name for each.", "Give some.")
    model = _fitted(vectors, labels)
    log_densities, right = _by_others(vectors, labels)
    return replace(model, sharpness=_sharpness(model, log_densities, right))


def leave_one_out(vectors: FloatArray, labels: Sequence[str]) -> list[Answer]:
    """Answer for each scan by a model of all the others.

    A shape of which this is the only scan is unknown to that model. Its sharpness is learned from
    what the other scans were named.
    """
    log_densities, right = _by_others(vectors, labels)
    tried = [i for i, label in enumerate(labels) if labels.count(label) > 1]
    answers = []
    for i, vector in enumerate(vectors):
        rest = np.delete(vectors, i, axis=0), [*labels[:i], *labels[i + 1 :]]
        if i in tried:
            model = _fitted(*rest)
            others = [row for row, j in enumerate(tried) if j != i]
            sharpness = _sharpness(model, log_densities[others], right[others])
            model = replace(model, sharpness=sharpness)
        else:
            model = train(*rest)
        answers.append(model.answer(vector))
    return answers


def leave_shape_out(vectors: FloatArray, labels: Sequence[str]) -> list[Answer]:
    """Answer for each scan by a model that knows all other shapes, and not its own."""
    models = {}
    for label in dict.fromkeys(labels):
        others = [i for i, other in enumerate(labels) if other != label]
        models[label] = train(vectors[others], [labels[i] for i in others])
    return [models[label].answer(vector) for vector, label in zip(vectors, labels, strict=True)]


def _fitted(vectors: FloatArray, labels: Sequence[str]) -> Model:
    names = tuple(sorted(set(labels)))
    groups = [vectors[[label == name for label in labels]] for name in names]
    means = np.stack([group.mean(axis=0) for group in groups])
    scatter = PRIOR_SCANS * np.diag([feature.spread**2 for feature in FEATURES])
    for group, mean in zip(groups, means, strict=True):
        scatter = scatter + (group - mean).T @ (group - mean)
    freedom = PRIOR_SCANS + len(labels) - len(names)
    return Model(
        shapes=names,
        scans=tuple(len(group) for group in groups),
        means=means,
        covariance=scatter / freedom,
        freedom=float(freedom),
    )


def _by_others(vectors: FloatArray, labels: Sequence[str]) -> tuple[FloatArray, NDArray[np.int64]]:
    """What models of the others say of each scan, (m, k), and which shape is right, (m,).

    Scans that are the only one of their shape are left out.
    """
    names = sorted(set(labels))
    rows, right = [], []
    for i, label in enumerate(labels):
        if labels.count(label) > 1:
            others = _fitted(np.delete(vectors, i, axis=0), [*labels[:i], *labels[i + 1 :]])
            rows.append(others._distances(vectors[i])[1])
            right.append(names.index(label))
    return np.array(rows).reshape(-1, len(names)), np.array(right, dtype=np.int64)


def _sharpness(model: Model, log_densities: FloatArray, right: NDArray[np.int64]) -> float:
    """Power of the densities, not above 1, under which the right names are likeliest."""
    shapes = len(model.shapes)
    if shapes == 1:
        return 1.0
    tried = len(right)
    if not tried:  # one scan of each: nobody has tried
        log_densities = np.stack([model._distances(mean)[1] for mean in model.means])
        right = np.arange(shapes)
    aim = np.full(log_densities.shape, 1 / (tried + 2) / (shapes - 1))
    aim[np.arange(len(right)), right] = (tried + 1) / (tried + 2)
    # The likelihood has one maximum, and its slope falls: it is halved in.
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if ((aim - _shares(log_densities, middle)) * log_densities).sum() > 0:
            low = middle
        else:
            high = middle
    return low


def _shares(log_densities: FloatArray, sharpness: float) -> FloatArray:
    """Shares of densities to a power, (..., k)."""
    power = sharpness * (log_densities - log_densities.max(axis=-1, keepdims=True))
    share = np.exp(power)
    return np.asarray(share / share.sum(axis=-1, keepdims=True))


def save(path: str | Path, model: Model) -> Path:
    """Write a model as JSON.

    Raises
    ------
    InputError
        The file can't be written.
    """
    path = Path(path)
    document = {
        "kind": _KIND,
        "version": _VERSION,
        "features": [feature.name for feature in FEATURES],
        "shapes": {
            name: {"scans": count, "mean": [float(value) for value in mean]}
            for name, count, mean in zip(model.shapes, model.scans, model.means, strict=True)
        },
        "covariance": [[float(value) for value in row] for row in model.covariance],
        "freedom": model.freedom,
        "sharpness": model.sharpness,
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{path} can't be written: {error.strerror or error}.", "Give another name."
        ) from error
    return path


def load(path: str | Path) -> Model:
    """Read a model. It is data alone: nothing in the file is run.

    Raises
    ------
    InputError
        The file can't be read, holds no model, or one of other features.

    Examples
    --------
    >>> import tempfile
    >>> model = train(np.eye(6)[:2], ["egg", "box"])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load(save(Path(folder) / "shapes.json", model)).shapes
    ('box', 'egg')
    """
    remedy = "Give a file that `setae cluster --model` wrote."
    try:
        document: Any = json.loads(Path(path).read_text(encoding="utf-8"))
        if (document["kind"], document["version"]) != (_KIND, _VERSION):
            raise ValueError("another kind or version")
        if document["features"] != [feature.name for feature in FEATURES]:
            raise ValueError("its features are others than this version's")
        shapes = {str(name): entry for name, entry in document["shapes"].items()}
        return Model(
            shapes=tuple(shapes),
            scans=tuple(int(entry["scans"]) for entry in shapes.values()),
            means=np.array([entry["mean"] for entry in shapes.values()], dtype=np.float64),
            covariance=np.array(document["covariance"], dtype=np.float64),
            freedom=float(document["freedom"]),
            sharpness=float(document["sharpness"]),
        )
    except OSError as error:
        raise InputError(f"{path} can't be read: {error.strerror or error}.", remedy) from error
    except InputError as error:
        raise InputError(f"{path}: {error.problem}", remedy) from error
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as error:
        raise InputError(f"{path} holds no model of shapes: {error}.", remedy) from error
