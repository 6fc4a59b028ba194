"""What an injected fault is: the view that has it, and the truth about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView

Box = tuple[float, float, float, float]
Kind = Literal["none", "kidnap", "wrong_start", "appeared", "removed", "moved"]


@dataclass(frozen=True, eq=False)
class Injection:
    """A view with one fault in it, and the truth about that fault.

    Attributes:
        kind: what was done.
        view: the evidence with the fault in it.
        from_ns: the fault holds from here to the log's end, on the view's own clock.
        box_m: of a map edit x_min, y_min, x_max, y_max in the map frame: where the map is wrong
            now. Of a moved structure it is where the structure really stands.
        from_box_m: of a moved structure, where the map draws it.
        cut_ns: of a kidnap, the stretch [start, end) of the log that was cut out, as recorded.
    """

    kind: Kind
    view: BundleView
    from_ns: int
    box_m: Box | None = None
    from_box_m: Box | None = None
    cut_ns: tuple[int, int] | None = None

    def recorded_ns(self, t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Times (N,) of the view on the clock of the log as it was recorded."""
        if self.cut_ns is None:
            return t_ns
        start, end = self.cut_ns
        return np.where(t_ns < start, t_ns, t_ns + (end - start))
