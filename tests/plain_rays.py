"""Ray casting as Amanatides and Woo write it, to hold ours against; plain Python, or compiled."""

import numpy as np


def first_wall(walls, x, y, dx, dy, limit):
    """Distance in cells from (x, y) along the unit vector (dx, dy) to the first wall, or inf."""
    height, width = walls.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    step_col, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    delta_col = np.inf if dx == 0.0 else abs(1.0 / dx)
    delta_row = np.inf if dy == 0.0 else abs(1.0 / dy)
    to_col = np.inf if dx == 0.0 else ((col + 1 - x) if dx > 0 else (x - col)) * delta_col
    to_row = np.inf if dy == 0.0 else ((row + 1 - y) if dy > 0 else (y - row)) * delta_row
    travelled = 0.0
    while travelled <= limit:
        inside = 0 <= row < height and 0 <= col < width
        if inside and walls[row, col]:
            return travelled
        if not inside and (
            (col < 0 and dx <= 0)
            or (col >= width and dx >= 0)
            or (row < 0 and dy <= 0)
            or (row >= height and dy >= 0)
        ):
            return np.inf  # outside and leaving
        if to_col < to_row:
            travelled = to_col
            to_col += delta_col
            col += step_col
        else:
            travelled = to_row
            to_row += delta_row
            row += step_row
    return np.inf


def cast(walls, resolution, poses, bearings, max_range, out):
    """Fill in `out` (N, M) in metres, for poses (N, 3) in the grid's own frame."""
    for i in range(poses.shape[0]):
        for j in range(bearings.shape[0]):
            angle = poses[i, 2] + bearings[j]
            out[i, j] = resolution * first_wall(
                walls,
                poses[i, 0] / resolution,
                poses[i, 1] / resolution,
                np.cos(angle),
                np.sin(angle),
                max_range / resolution,
            )
