"""What a lab is: a model of what a recipe may set, and a function from it to results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What `run` is given: a few words, and the share done from 0 to 1.
Progress = Callable[[str, float], None]


def _one_line(text: str) -> str:
    if " ".join(text.split()) != text or "|" in text:
        raise ValueError("should be one line of text without |")
    return text


#: A name that a recipe gives to a thing of its own: a cell of a table.
GivenName = Annotated[str, Field(min_length=1, max_length=60), AfterValidator(_one_line)]


class Strict(BaseModel):
    """Keys that are not known, numbers as texts, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


@dataclass(frozen=True)
class ResultTable:
    """Rows as a reader wants them.

    Attributes:
        title: what the table shows.
        head: names of the columns, with units.
        rows: cells as text.
        brief: names of the columns that a terminal has room for; all where it is empty.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    brief: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class LabResults:
    """What a lab found.

    Attributes:
        numbers: what goes to results.json; None for what there is not, never NaN.
        tables: what goes to results.md, and to the terminal.
        notes: sentences that the numbers need: how labels are decided, what an interval is.
        figures: by name of file, each drawn when asked for.
    """

    numbers: Mapping[str, Any]
    tables: Sequence[ResultTable]
    notes: Sequence[str]
    figures: Mapping[str, Callable[[], Figure]]


class Lab(Strict):
    """A question that a simulation answers; its fields are what a recipe sets, all of them.

    The first line of a lab's docstring is what `slamreplay list labs` says of it.
    """

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """The answer: same fields and seed, same numbers."""
        raise NotImplementedError
