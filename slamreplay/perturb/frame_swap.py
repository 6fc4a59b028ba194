"""Frames that were taken for each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.perturb.beams import scan_rows
from slamreplay.perturb.odometry_path import with_odometry
from slamreplay.perturb.variant import Variant, check_level, switch


@dataclass(frozen=True)
class FrameSwap:
    """Exchange parent and child of a transform, or tell scans in the wrong frame; 1 does it.

    A transform with its frames exchanged is its inverse between the right ones: so it is done, for
    tf then keeps one parent for each frame.
    """

    name: ClassVar[str] = "frame_swap"
    variants: ClassVar[dict[str, Variant]] = {
        "odometry": switch("odometry and base exchanged, on tf and on the topic"),
        "laser": switch("the laser and the frame that it is mounted on exchanged"),
        "scan_in_base": switch("scans told in the base's frame: the mount is not there"),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms", "scans"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with these frames.

        Raises:
            NotApplicableError: the log does not have them, or the laser sits where it makes no
                difference.
            UsageError: the level is neither 0 nor 1.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant == "odometry":
            return with_odometry(view, self.name, lambda _, xyyaw: se2.inverse(xyyaw))
        return self._laser(view) if variant == "laser" else self._scans(view)

    def _laser(self, view: BundleView) -> BundleView:
        _, laser = self._mount(view)
        path = view.transforms.path(view.manifest.frames.base or "", laser)
        edge = next(edge for edge in path if laser in (edge.child, edge.parent))
        table = view.table("transforms")
        names = table["parent_frame"] == edge.parent, table["child_frame"] == edge.child
        rows = np.flatnonzero(names[0] & names[1])
        translation, rotation = table["translation_xyz"].copy(), table["rotation_xyzw"].copy()
        T = se3.matrix(translation[rows], rotation[rows])
        back = se3.inverse(T)
        if np.allclose(T, back, atol=1e-9):
            what = f"between {edge.parent} and {edge.child} nothing changes when they are exchanged"
            raise NotApplicableError(what, where=self.name)
        translation[rows], rotation[rows] = back[:, :3, 3], se3.quaternion(back[:, :3, :3])
        return view.with_table(table.replace(translation_xyz=translation, rotation_xyzw=rotation))

    def _scans(self, view: BundleView) -> BundleView:
        rows, laser = self._mount(view)
        base = view.manifest.frames.base or ""
        fixed = view.transforms.fixed(base, laser)
        if fixed is not None and np.allclose(fixed, np.eye(4), atol=1e-9):
            what = f"{laser} lies on {base}: scans are the same in both"
            raise NotApplicableError(what, where=self.name)
        table = view.table("scans")
        frame = table["frame_id"].copy()
        frame[rows] = base
        return view.with_table(table.replace(frame_id=frame))

    def _mount(self, view: BundleView) -> tuple[np.ndarray, str]:
        """Rows of the scans, and their frame, which tf places on the robot."""
        rows, base = scan_rows(view, self.name), view.manifest.frames.base or ""
        laser = str(view.table("scans")["frame_id"][rows[0]])
        if laser == base or not view.transforms.has_path(base, laser):
            raise NotApplicableError("tf does not say where the laser is mounted", where=self.name)
        return rows, laser
