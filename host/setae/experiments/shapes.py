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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """What came out.

    Attributes
    ----------
    samples
        The scans, by label, the paper's objects first; n of them.
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
        """Of the paper's data in the plane of t-SNE."""
        return paper.silhouette(self.plane, self.labels)


def compare(samples: Sequence[Sample]) -> Comparison:
    """Compare labelled scans.

    Raises
    ------
    InputError
        There are too few, one has no label, or too few heights for a shape.
    """
    for sample in samples:
        if sample.label is None:
            raise InputError(
                f"Nobody knows what {sample.name} is a scan of.", "Give it as NAME=PATH."
            )
    # The paper's objects in its order, then all others.
    order = {shape: number for number, shape in enumerate(SHAPES)}
    samples = sorted(
        samples, key=lambda one: (order.get(str(one.label), len(order)), str(one.label))
    )
    labels = [str(sample.label) for sample in samples]
    if len(set(labels)) < 2:
        raise InputError(
            "There is nothing to compare.", "Give scans of two objects or more, best five of each."
        )
    rows = []
    for sample in samples:
        try:
            rows.append(features.described(sample.heights))
        except InputError as error:
            raise InputError(f"{sample.name}: {error.problem}", error.remedy) from error
    vectors = np.stack(rows)
    data = np.stack(
        [paper.normalised(sample.heights, reach_mm=sample.reach_mm) for sample in samples]
    )
    return Comparison(
        samples=tuple(samples),
        labels=tuple(labels),
        vectors=vectors,
        data=data,
        plane=paper.embedded(data),
        answers=tuple(classifier.leave_one_out(vectors, labels)),
        strangers=tuple(classifier.leave_shape_out(vectors, labels)),
        nearness=tuple(
            nearness(sample.heights, sample.solids, reach_mm=sample.reach_mm)
            if sample.scene
            else None
            for sample in samples
        ),
        model=classifier.train(vectors, labels),
    )
