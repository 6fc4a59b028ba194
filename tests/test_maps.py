"""Map files by map_server's rules, and rays against a march in tiny steps."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from slamreplay.errors import MapError
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field, gaussian_field
from slamreplay.maps.map_server import map_files, read_map
from slamreplay.maps.raycast import cast_rays


def write(folder, pixels, text, name="m.pgm"):
    Image.fromarray(np.array(pixels, dtype=np.uint8)).save(folder / name)
    (folder / "m.yaml").write_text(text)
    return folder / "m.yaml"


HEAD = "resolution: 0.5\norigin: [1.0, 2.0, 0.0]\n"


def quiet(sentence):
    raise AssertionError(sentence)


def test_trinary_map_is_flipped_and_split_at_the_thresholds(tmp_path):
    text = f"image: m.pgm\n{HEAD}negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    path = write(tmp_path, [[0, 254], [205, 100]], text)

    grid = read_map(path, warn=quiet)

    assert grid.cells.tolist() == [[-1, -1], [100, 0]]
    np.testing.assert_allclose(grid.centre_of([0, 0]), [1.25, 2.25])


def test_negated_and_scaled_maps(tmp_path):
    text = (
        f"image: m.pgm\n{HEAD}negate: true\nmode: scale\noccupied_thresh: 0.8\nfree_thresh: 0.2\n"
    )
    path = write(tmp_path, [[0, 128, 255]], text)

    assert read_map(path, warn=quiet).cells.tolist() == [[0, 50, 100]]


def test_transparent_pixels_are_unknown(tmp_path):
    path = write(tmp_path, [[0]], f"image: m.png\n{HEAD}", "other.pgm")
    Image.fromarray(np.array([[[0, 0, 0, 255], [0, 0, 0, 9]]], np.uint8), "RGBA").save(
        tmp_path / "m.png"
    )

    assert read_map(path, warn=quiet).cells.tolist() == [[100, -1]]


def test_nan_yaw_and_foreign_path_are_mended_with_a_word(tmp_path):
    text = "image: /home/somebody/m.pgm\nresolution: 0.5\norigin: [1.0, 2.0, nan]\n"
    path = write(tmp_path, [[0, 254]], text.replace("nan", ".nan"))
    said = []

    grid = read_map(path, warn=said.append)

    assert grid.origin_xyyaw.tolist() == [1.0, 2.0, 0.0]
    assert len(said) == 2


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"image: gone.pgm\n{HEAD}", "image 'gone.pgm' is missing"),
        ("image: m.pgm\nresolution: 0.5\n", "lacks origin"),
        (f"image: m.pgm\n{HEAD}mode: cubic\n", "mode 'cubic'"),
        ("image: m.pgm\nresolution: -1\norigin: [0, 0, 0]\n", "resolution is -1.0"),
        ("image: m.pgm\nresolution: fine\norigin: [0, 0, 0]\n", "not numeric"),
        ("- just\n- a list\n", "holds no keys"),
        ("!!python/object/apply:os.system ['true']\n", "not a map yaml"),
    ],
)
def test_bad_map_yamls_are_named(tmp_path, text, says):
    path = write(tmp_path, [[0, 254]], text)

    with pytest.raises(MapError, match=says) as caught:
        read_map(path, warn=quiet)

    assert "\n" not in str(caught.value)


def test_an_image_in_the_yamls_place_is_said(tmp_path):
    (tmp_path / "m.pgm").write_bytes(b"P5\n1 1\n255\n\xcd")

    with pytest.raises(MapError, match="it is no text") as caught:
        read_map(tmp_path / "m.pgm", warn=quiet)

    assert "give the yaml" in str(caught.value)


def test_image_that_is_no_image(tmp_path):
    (tmp_path / "m.pgm").write_text("P5 nonsense")
    (tmp_path / "m.yaml").write_text(f"image: m.pgm\n{HEAD}")

    with pytest.raises(MapError, match="cannot be read"):
        read_map(tmp_path / "m.yaml", warn=quiet)


def test_map_files_read_back(tmp_path):
    cells = np.array([[0, 100, -1], [100, 0, 0]], dtype=np.int8)
    grid = OccupancyGrid(cells, 0.05, np.array([-1.0, 3.0, 0.4]))
    for name, content in map_files(grid, "changed").items():
        (tmp_path / name).write_bytes(content)

    back = read_map(tmp_path / "changed.yaml", warn=quiet)

    assert back.version == grid.version


def test_version_tells_content_and_place_apart():
    cells = np.array([[0, 100]], dtype=np.int8)
    versions = {
        OccupancyGrid(cells, 0.05, np.zeros(3)).version,
        OccupancyGrid(cells, 0.06, np.zeros(3)).version,
        OccupancyGrid(cells, 0.05, np.array([0, 0, 0.1])).version,
        OccupancyGrid(cells[:, ::-1], 0.05, np.zeros(3)).version,
        OccupancyGrid(cells.T, 0.05, np.zeros(3)).version,
    }

    assert len(versions) == 5


@given(st.tuples(st.floats(-9, 9), st.floats(-9, 9)))
def test_cells_and_centres_fit_in_a_turned_map(xy):
    grid = OccupancyGrid(np.zeros((40, 60), np.int8), 0.1, np.array([-3.0, 1.0, 0.8]))

    centre = grid.centre_of(grid.cell_of(np.array(xy)))

    assert np.abs(centre - xy).max() <= 0.1 * np.sqrt(0.5) + 1e-9


def room():
    rng = np.random.default_rng(3)
    cells = (rng.random((30, 40)) < 0.05).astype(np.int8) * 100
    cells[10:14, 10:14] = 0
    return OccupancyGrid(cells, 0.25, np.array([-2.0, -1.0, 0.4]))


def marched(grid, pose, bearing, max_range):
    """Range to the first wall, by steps of a hundredth of a cell."""
    for r in np.arange(0, max_range, grid.resolution_m / 100):
        xy = pose[:2] + r * np.array([np.cos(pose[2] + bearing), np.sin(pose[2] + bearing)])
        cell = grid.cell_of(xy)
        if grid.inside(cell) and grid.occupied[tuple(cell)]:
            return r
    return np.inf


def touches(grid, pose, bearing, r):
    """Whether a wall is within a fiftieth of a cell of the ray's point at range r."""
    xy = pose[:2] + r * np.array([np.cos(pose[2] + bearing), np.sin(pose[2] + bearing)])
    near = grid.resolution_m / 50 * np.array([(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)])
    cells = [grid.cell_of(xy + step) for step in near]
    return any(grid.inside(cell) and grid.occupied[tuple(cell)] for cell in cells)


@settings(max_examples=25, deadline=None)
@given(st.floats(-3.1, 3.1))
@example(0.8853942734469982)  # a corner that the march steps over
def test_rays_agree_with_a_march(bearing):
    grid = room()
    pose = np.append(grid.centre_of([12, 12]), 0.3)

    got = cast_rays(grid, pose[None], np.array([bearing]), 20.0)[0, 0]

    expected = marched(grid, pose, bearing, 20.0)
    if np.isinf(expected):
        assert got > 10 or touches(grid, pose, bearing, got)
    else:  # a corner can be grazed between two steps
        grazed = got < expected and touches(grid, pose, bearing, got)
        assert abs(got - expected) < 0.36 or grazed


def test_ray_along_an_axis_is_exact():
    cells = np.zeros((3, 10), np.int8)
    cells[1, 7] = 100
    grid = OccupancyGrid(cells, 0.5, np.zeros(3))

    got = cast_rays(grid, np.array([[0.25, 0.75, 0.0]]), np.array([0.0, np.pi]), 9.0)

    np.testing.assert_allclose(got, [[3.25, np.inf]])


def test_ray_from_outside_reaches_the_map():
    cells = np.zeros((3, 3), np.int8)
    cells[1, 0] = 100
    grid = OccupancyGrid(cells, 1.0, np.zeros(3))

    got = cast_rays(grid, np.array([[-4.0, 1.5, 0.0]]), np.array([0.0, np.pi]), 9.0)

    np.testing.assert_allclose(got, [[4.0, np.inf]])


def test_fields_of_a_single_wall():
    cells = np.zeros((5, 5), np.int8)
    cells[2, 2] = 100
    grid = OccupancyGrid(cells, 0.1, np.zeros(3))

    distance = distance_field(grid, 0.15)

    assert distance[2, 2] == 0
    np.testing.assert_allclose(distance[2, 3], 0.1, rtol=1e-6)
    np.testing.assert_allclose(distance[0, 0], 0.15, rtol=1e-6)
    np.testing.assert_allclose(gaussian_field(grid, 0.1, 0.15)[2, 3], np.exp(-0.5), rtol=1e-6)


def test_map_without_walls_scores_nothing():
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), 0.1, np.zeros(3))

    assert np.all(distance_field(grid, 2.0) == 2.0)


def test_points_follow_a_turned_origin():
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), 1.0, np.array([0.0, 0.0, np.pi / 6]))

    np.testing.assert_allclose(
        grid.centre_of([0, 1]), se2.transform_points([0, 0, np.pi / 6], [[1.5, 0.5]])[0]
    )
