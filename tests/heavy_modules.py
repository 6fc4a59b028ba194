"""What no command may import before it works: each takes a large part of a second."""

HEAVY = (
    "numpy", "pandas", "scipy", "numba", "gtsam", "open3d", "matplotlib", "rosbags", "pyarrow",
    "dask", "distributed", "fsspec",
)  # fmt: skip
