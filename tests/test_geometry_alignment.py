"""Points laid onto points, a few of which lie elsewhere."""

import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.geometry.alignment import aligned


@pytest.mark.parametrize("motion", [(3.0, -2.0, 0.4), (0.0, 100.0, 3.0), (0.0, 0.0, 0.0)])
def test_the_motion_is_found_though_some_points_lie(motion):
    rng = np.random.Generator(np.random.PCG64(0))
    points = rng.uniform(-10.0, 10.0, (60, 2))
    onto = se2.transform_points(np.array(motion), points) + rng.normal(0.0, 0.01, (60, 2))
    onto[:12] += rng.uniform(-5.0, 5.0, (12, 2))

    np.testing.assert_allclose(aligned(points, onto), motion, atol=0.02)
