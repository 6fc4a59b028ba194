"""What there is, and what a finding means: `sr.list` and `sr.explain`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def list_(kind: str) -> pd.DataFrame:
    """What there is of a kind, with a line about each.

    Args:
        kind: estimators, perturbations, checks, decoders, scenarios, findings or labs.

    Raises:
        UsageError: there is no such kind.

    >>> import slamreplay as sr
    >>> known = sr.list("perturbations").set_index("name")
    >>> known.loc["tf_delay.odometry", "unit"]
    's'
    """
    import pandas as pd

    from slamreplay.catalogue import catalogue

    return pd.DataFrame(catalogue(kind))


@dataclass(frozen=True)
class Explained:
    """What a finding asks, how, and when it misleads; shows itself as text and Markdown."""

    id: str
    title: str
    asks: str
    method: str
    misleads: str

    def __str__(self) -> str:
        told = (("it asks", self.asks), ("how", self.method), ("it misleads", self.misleads))
        lines = [f"{head}: {' '.join(text.split())}" for head, text in told]
        return "\n".join([f"{self.id}  {self.title}", *lines])

    def __repr__(self) -> str:
        return str(self)

    def _repr_markdown_(self) -> str:
        from slamreplay.evidence.clean import as_markdown

        head, *lines = str(self).split("\n")
        parts = [line.partition(": ") for line in lines]
        told = [f"**{name}**: {as_markdown(text)}" for name, _, text in parts]
        return "\n\n".join([f"### {as_markdown(head)}", *told])


def explain(finding: str) -> Explained:
    """What a finding means.

    Args:
        finding: its id.

    Raises:
        UsageError: there is no such finding.

    >>> import slamreplay as sr
    >>> sr.explain("sr-loc-001").id
    'SR-LOC-001'
    """
    from slamreplay.catalogue import explanation_of

    id_, told = explanation_of(finding)
    return Explained(id_, told.title, told.asks, told.method, told.misleads)
