"""Scans of several objects side by side: how far apart they lie, and which are told apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from setae.arc import FloatArray
from setae.errors import InputError
from setae.experiments.samples import Sample
from setae.objects import SHAPES
from setae.perception import classifier, features, paper
from setae.perception.classifier import Answer, Model
from setae.perception.measures import Nearness, nearness

__all__ = ["Comparison", "compare"]


# Fewer make no picture of clusters.
_FEWEST = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """What came out.

    Attributes
    ----------
    samples
        The scans, by label, the paper's objects first; n of them.
    left_out
        Of each other scan, why it isn't among them.
    labels
        What was scanned, (n,).
    vectors
        Descriptions, (n, f), see `setae.perception.features`.
    data
        The paper's normalised data, (n, 300).
    plane
        t-SNE of these, (n, 2).
    answers
        For each scan what a model of all the others says.
    strangers
        For each scan what a model without its shape says.
    nearness
        Of each scan to the true surface; None where that is not known.
    model
        Of all scans.
    """

    samples: tuple[Sample, ...]
    left_out: tuple[str, ...]
    labels: tuple[str, ...]
    vectors: FloatArray
    data: FloatArray
    plane: FloatArray
    answers: tuple[Answer, ...]
    strangers: tuple[Answer, ...]
    nearness: tuple[Nearness | None, ...]
    model: Model

    @property
    def shapes(self) -> tuple[str, ...]:
        """Different labels."""
        return tuple(dict.fromkeys(self.labels))

    @property
    def accuracy(self) -> float:
        """Part of the scans that a model of all the others names right; unknown is wrong."""
        pairs = zip(self.answers, self.labels, strict=True)
        return float(np.mean([answer.shape == label for answer, label in pairs]))

    @property
    def unknown(self) -> float:
        """Part of the scans that are unknown to a model without their shape."""
        return float(np.mean([not answer.known for answer in self.strangers]))

    @property
    def silhouette(self) -> float:
        """Of the descriptions, each number in units of its expected spread."""
        return paper.silhouette(features.scaled(self.vectors), self.labels)

    @property
    def silhouette_paper(self) -> float:
        """Of the paper's normalised data."""
        return paper.silhouette(self.data, self.labels)

    @property
    def silhouette_plane(self) -> float:
        """Of the heights, normalised as in the paper, in the plane of t-SNE."""
        return paper.silhouette(self.plane, self.labels)


def compare(samples: Sequence[Sample]) -> Comparison:
    """Compare labelled scans. Those that have no label or no shape are left out, and told.

    Raises
    ------
    InputError
        Too few are left.
    """
    # The paper's objects in its order, then all others.
    order = {shape: number for number, shape in enumerate(SHAPES)}
    kept: list[Sample] = []
    vectors, data, left_out = [], [], []
    for sample in sorted(
        samples, key=lambda one: (order.get(str(one.label), len(order)), str(one.label))
    ):
        try:
            _require_new(sample, kept)
            described = _described(sample)
            normalised = paper.normalised(sample.heights, reach_mm=sample.reach_mm)
        except InputError as error:
            left_out.append(f"{sample.name} is left out: {error}")
            continue
        kept.append(sample)
        vectors.append(described)
        data.append(normalised)
    labels = [str(sample.label) for sample in kept]
    if len(set(labels)) < 2 or len(labels) < _FEWEST:
        raise InputError(
            " ".join(["There is nothing to compare.", *left_out]),
            "Give scans of two objects or more, best five of each.",
        )
    return Comparison(
        samples=tuple(kept),
        left_out=tuple(left_out),
        labels=tuple(labels),
        vectors=np.stack(vectors),
        data=np.stack(data),
        plane=paper.embedded(np.stack(data)),
        answers=tuple(classifier.leave_one_out(np.stack(vectors), labels)),
        strangers=tuple(classifier.leave_shape_out(np.stack(vectors), labels)),
        nearness=tuple(
            nearness(sample.heights, sample.solids, reach_mm=sample.reach_mm)
            if sample.scene
            else None
            for sample in kept
        ),
        model=classifier.train(np.stack(vectors), labels),
    )


def _require_new(sample: Sample, kept: Sequence[Sample]) -> None:
    """Raise InputError where a scan is there already: it would vouch for its twin."""
    for other in kept:
        if sample.heights.same_as(other.heights):
            raise InputError(f"It is the same as {other.name}.", "Every scan counts once.")


def _described(sample: Sample) -> FloatArray:
    if sample.label is None:
        if sample.scene is not None:
            raise InputError("It is a scan of a bare table.", "Nothing is to be told of it.")
        raise InputError("Nobody knows what it is a scan of.", "Give it as NAME=PATH.")
    return features.described(sample.heights)
