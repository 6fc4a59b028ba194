"""The same registration through Open3D, to compare with: the only module that loads it.

Open3D registers points in space. The normals it estimates on a flat cloud may point out of the
plane, where point to plane holds nothing in it; so it is given those of the lines in the plane.
"""

from __future__ import annotations

import ctypes
from dataclasses import replace
from typing import Any

import numba
import numpy as np

from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.matching.icp import IcpSettings, Registration, icp
from slamreplay.matching.line_target import LineTarget


def icp_open3d(
    target: LineTarget,
    points: se2.Array,
    guess: se2.Array,
    settings: IcpSettings | None = None,
) -> Registration:
    """`matching.icp.icp` with the steps taken by Open3D, which does not tell how many.

    How well the pose fits and what holds it is judged as there. Open3D moves along directions that
    nothing holds, too.

    Raises:
        NotApplicableError: Open3D cannot be loaded.
    """
    settings = settings or IcpSettings()
    pose = np.asarray(guess, dtype=np.float64)
    rested = False
    if len(points) and len(target.points):
        pose, rested = _registered(target, points, pose, settings)
    return replace(icp(target, points, pose, replace(settings, most_steps=0)), converged=rested)


def _registered(
    target: LineTarget, points: se2.Array, guess: se2.Array, settings: IcpSettings
) -> tuple[se2.Array, bool]:
    o3d = _open3d()
    registration = o3d.pipelines.registration
    found = registration.registration_icp(
        _cloud(o3d, points),
        _cloud(o3d, target.points - target.off[:, None] * target.normals, target.normals),
        settings.reach_m,
        _matrix(guess),
        registration.TransformationEstimationPointToPlane(
            registration.TukeyLoss(k=settings.reach_m / 5.0)
        ),
        registration.ICPConvergenceCriteria(max_iteration=settings.most_steps),
    )
    T = np.asarray(found.transformation)
    return np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])]), found.fitness > 0.0


def _open3d() -> Any:
    """Open3D, which wants libusb even where there is no device: the wheel of it will do.

    It brings a TBB that is too old for numba, which warns of it when it first looks at its threads
    and finds that loaded; so it looks now.
    """
    numba.get_num_threads()
    try:
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        pass  # not packaged for this machine: it may have one of its own
    try:
        import open3d
    except (ImportError, OSError) as error:
        raise NotApplicableError(
            f"Open3D cannot be loaded: {str(error).splitlines()[0]}",
            hint="matching.icp needs no other library",
        ) from error
    return open3d


def _cloud(o3d: Any, points: se2.Array, normals: se2.Array | None = None) -> Any:
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(_flat(points)))
    if normals is not None:
        cloud.normals = o3d.utility.Vector3dVector(_flat(normals))
    return cloud


def _flat(vectors: se2.Array) -> se2.Array:
    return np.column_stack([vectors, np.zeros(len(vectors))])


def _matrix(xyyaw: se2.Array) -> se2.Array:
    T = np.eye(4)
    cos, sin = np.cos(xyyaw[2]), np.sin(xyyaw[2])
    T[:2, :2] = [[cos, -sin], [sin, cos]]
    T[:2, 3] = xyyaw[:2]
    return T
