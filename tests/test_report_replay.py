"""The replay's payload: what comes out is what went in, to the rounding that is told."""

import base64
import hashlib
import json
import re
import zlib
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from slamreplay.bundle.map_course import Held, MapStretch
from slamreplay.bundle.met import BeamsMet
from slamreplay.bundle.products import ChangedRegion, Changes, Hindsight, Part
from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import (
    Lane,
    Mark,
    Met,
    Scene,
    SceneClouds,
    ScenePlans,
    SceneScans,
)
from slamreplay.geometry import se2
from slamreplay.report.html import _SCRIPTS, html
from slamreplay.report.replay.beams import REMOVED_UNSEEN, packed_scans
from slamreplay.report.replay.ground import ground_of
from slamreplay.report.replay.packing import as_text, packed, short_floats
from slamreplay.report.replay.replay import replay_of
from slamreplay.report.replay.tracks import Ticks, packed_track
from slamreplay.report.replay.words import rows_left_out
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path
from slamreplay.verdict.judgement import ConstantOffset, FailureMode, Interval, Judgement
from slamreplay.verdict.limits import Limits

S = 1_000_000_000
N = 40
HOSTILE = "</script><script>alert(1)</script> <!-- \" ' & \x00 \ud800 \u202e"
SHOWN = "</script><script>alert(1)</script> <!-- \" ' & \ufffd \ufffd [U+202E]"


def unpacked(text):
    """Head and arrays of a payload, by the words of its format and nothing of its maker."""
    data = zlib.decompress(base64.b64decode(text, validate=True))
    size = int(np.frombuffer(data[:4], "<u4")[0])
    head = json.loads(data[4 : 4 + size])
    arrays, at = {}, 4 + size
    for name, kind, *shape in head["arrays"]:
        dtype, count = np.dtype(kind).newbyteorder("<"), int(np.prod(shape))
        planes = np.frombuffer(data, np.uint8, count * dtype.itemsize, at)
        at += planes.size
        values = planes.reshape(dtype.itemsize, count).T.copy().view(dtype).ravel()
        if dtype.kind == "i":
            values = np.cumsum(values, dtype=dtype)
        arrays[name] = values.reshape(shape)
    assert at == len(data)
    return head, arrays


def track(t_ns, xyyaw, cov=None):
    cov = np.full((len(t_ns), 3, 3), np.nan) if cov is None else cov
    return PoseTrack("map", "base_link", t_ns, xyyaw, cov)


def scans_of(n=N, beams=30, seed=0):
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-20.0, 20.0, (n, beams, 2)).astype(np.float32)
    met = rng.integers(0, 6, (n, beams)).astype(np.uint8)
    t_ns = START_NS + np.arange(n, dtype=np.int64) * (S // 10)
    return SceneScans(t_ns, ends, rng.random((n, beams)) < 0.8, met, np.array([0.1, 0.0]))


@pytest.fixture(scope="module")
def post() -> Postmortem:
    """Four seconds with everything that a scene can hold."""
    manifest = synthetic_bundle(seconds=4.0).manifest
    t_ns = START_NS + np.arange(N, dtype=np.int64) * (S // 10)
    truth = true_path((t_ns - START_NS) / S)
    cov = np.broadcast_to(np.diag([0.04, 0.01, 0.0025]), (N, 3, 3)).copy()
    grid = room_grid()
    appeared, removed = (np.zeros(grid.cells.shape, dtype=bool) for _ in range(2))
    appeared[60:75, 170:200] = True
    share = np.linspace(0.0, 0.2, N)
    region = ChangedRegion(
        "appeared", (1.0, 2.0, 3.0, 4.0), 1.0, int(t_ns[0]), int(t_ns[9]), 9, 0.9
    )
    changes = Changes(appeared, removed, (region,), t_ns, share, share, 0.0 * share)
    lasts = Interval("lost", START_NS, int(manifest.end_ns), 0.9, 1.0, 0.1)
    return Postmortem(
        manifest=manifest,
        grid=grid,
        belief=track(t_ns, truth + np.array([1.0, 0.0, 0.1]), cov),
        hindsight=Hindsight(track(t_ns, truth), 0.02, 1.0, np.full(N, 0.8), 0.1, changes),
        reference=None,
        reference_kind=None,
        judgement=Judgement("lost", 0.9, "", (lasts,), FailureMode("none", None, ()), (), (), ()),
        findings=(),
        limits=Limits(),
        scene=Scene(
            scans=(scans_of(),),
            clouds=SceneClouds(
                t_ns[:2], np.array([0, 3, 5]), np.arange(15.0).reshape(5, 3).astype(np.float32)
            ),
            plans=ScenePlans(t_ns[:1], np.array([0, 4]), np.ones((4, 2), dtype=np.float32)),
            footprint_xy=np.array([[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]),
            marks=(
                Mark("lost", int(t_ns[0]), int(t_ns[-1]), "Lost", "error"),
                Mark("stop", int(t_ns[7]), None, HOSTILE, "warning"),
            ),
            lanes=(
                Lane("error_m", "Position error", "m", t_ns, np.full(N, 1.0), 0.5),
                Lane("match", "Match", "", t_ns, np.where(np.arange(N) < 9, np.nan, 0.7), 0.3),
            ),
        ),
    )


@pytest.fixture
def page_of(monkeypatch):
    """Makes pages without their figures, which take seconds and are nothing to the replay."""
    monkeypatch.setattr("slamreplay.report.html._picture", lambda *_: None)
    return html


ARRAYS = st.sampled_from(["uint8", "int16", "int32", "float32"]).flatmap(
    lambda kind: npst.arrays(
        kind, npst.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=6)
    )
)


@given(st.dictionaries(st.text("ab_", min_size=1, max_size=3), ARRAYS, max_size=3), st.text())
def test_arrays_and_texts_come_back(arrays, text):
    head, back = unpacked(as_text(packed({"text": text}, arrays)))

    assert head["text"] == text
    assert list(back) == list(arrays)
    for name, array in arrays.items():
        np.testing.assert_array_equal(back[name], array)


def test_what_a_browser_cannot_read_is_refused():
    with pytest.raises(ValueError, match="int64"):
        packed({}, {"a": np.zeros(3, dtype=np.int64)})
    with pytest.raises(ValueError, match="JSON"):
        packed({"a": np.nan}, {})


@given(npst.arrays(np.float64, 5, elements=st.floats(-1e30, 1e30).filter(lambda v: abs(v) > 1e-30)))
def test_short_floats_keep_their_promise(values):
    assert np.all(np.abs(short_floats(values) - values) <= np.abs(values) / 8192 * 1.001)


def test_what_no_number_is_stays_none():
    np.testing.assert_array_equal(
        short_floats(np.array([np.nan, np.inf, -np.inf, 0.0])), [np.nan, np.inf, -np.inf, 0.0]
    )


@given(npst.arrays(np.float64, (6, 3), elements=st.floats(-1e5, 1e5)), st.integers(0, 2**50))
def test_poses_are_rounded_as_told(xyyaw, offset_ns):
    t_ns = START_NS + np.cumsum(np.full(6, S // 7)) + offset_ns % S
    origin = np.array([37.0, -12.0])
    arrays, every = packed_track("p", track(t_ns, xyyaw), Ticks.of(START_NS, START_NS + S), origin)
    pose = arrays["p_pose"]

    assert every == 1
    assert np.abs(arrays["p_t"] * 1e-4 - (t_ns - START_NS) / 1e9).max() <= 0.51e-4
    assert np.abs(pose[:2].T / 1000.0 + origin - xyyaw[:, :2]).max() <= 0.51e-3
    turn = se2.wrap_angle(np.radians(pose[2] / 100.0) - xyyaw[:, 2])
    assert np.degrees(np.abs(turn)).max() <= 0.0051


def test_gaps_of_a_path_are_marked_and_its_ellipses_are_the_covariances():
    xyyaw = np.zeros((5, 3))
    xyyaw[1] = np.nan
    turned_by = np.radians(30.0)
    R = np.array([[np.cos(turned_by), -np.sin(turned_by)], [np.sin(turned_by), np.cos(turned_by)]])
    cov = np.full((5, 3, 3), np.nan)
    cov[2] = np.diag([0.0, 0.0, 0.01])
    cov[2, :2, :2] = R @ np.diag([4.0, 0.25]) @ R.T
    t_ns = START_NS + np.arange(5, dtype=np.int64) * S
    arrays, _ = packed_track(
        "p", track(t_ns, xyyaw, cov), Ticks.of(START_NS, START_NS + S), np.zeros(2)
    )

    assert arrays["p_gap"].tolist() == [0, 1, 0, 0]
    ellipse = arrays["p_ellipse"]
    assert ellipse[[0, 1, 3], 1] == pytest.approx([2.0, 0.5, 0.1], rel=2e-4)
    assert np.sin(ellipse[2, 1] - turned_by) == pytest.approx(0.0, abs=1e-3)
    assert np.isnan(ellipse[:, [0, 2, 3]]).all()


@given(st.integers(1, 6), st.integers(1, 40), st.integers(0, 99))
def test_ends_are_within_half_a_centimetre(n, beams, seed):
    scans = scans_of(n, beams, seed)
    one = packed_scans(scans, np.ones(n, dtype=bool), 10**6)

    assert (one.thinning.scans, one.thinning.every_beam) == (one.thinning.of_scans, 1)
    drawn = one.met > 0
    off = one.ends * 0.01 - np.moveaxis(scans.ends_m, 2, 0)
    assert np.abs(off[:, drawn]).max(initial=0.0) <= 0.0051
    hits = scans.is_hit
    np.testing.assert_array_equal(
        one.met[hits & (scans.met > 0)], scans.met[hits & (scans.met > 0)]
    )
    assert (one.met[hits & (scans.met == 0)] == Met.OTHER).all()
    missed = ~hits
    gone = scans.met == Met.REMOVED
    assert (one.met[missed & gone] == REMOVED_UNSEEN).all()
    assert (one.met[missed & ~gone] == 0).all()


def test_ends_that_no_number_can_tell_are_not_drawn():
    scans = scans_of(1, 4)
    scans = replace(scans, is_hit=np.ones((1, 4), dtype=bool), met=np.ones((1, 4), dtype=np.uint8))
    scans.ends_m[0, 1], scans.ends_m[0, 2] = np.nan, 400.0

    assert packed_scans(scans, np.ones(1, dtype=bool), 10**6).met.tolist() == [[1, 0, 0, 1]]


@pytest.mark.parametrize("budget", [6_000, 20_000, 100_000])
def test_scans_keep_their_budget(budget):
    scans = scans_of(400, 900)
    one = packed_scans(scans, np.ones(400, dtype=bool), budget)
    told = one.thinning

    assert len(packed({}, {"ends": one.ends, "met": one.met})) <= budget * 1.05 + 200
    assert told.scans < told.of_scans or told.every_beam > 1
    assert (len(one.rows), one.met.shape[1]) == (told.scans, told.beams)
    steps = np.diff(one.rows)
    assert (one.rows[0], one.rows[-1]) == (0, 399)
    assert steps.max() - steps.min() <= 1
    assert told.beams == -(-900 // told.every_beam)


def test_the_whole_payload_keeps_its_budget(post):
    scene = replace(post.scene, scans=(scans_of(300, 600), scans_of(300, 600, 1)))
    many = replay_of(replace(post, scene=scene), budget=90_000)

    assert len(base64.b64decode(many.payload)) <= 90_000
    assert any(
        re.search(r"\d+ of \d+ scans of laser 1, every \w+ of 600 beams", n) for n in many.notes
    )


def test_everything_is_there(post):
    replay = replay_of(post)
    head, arrays = unpacked(replay.payload)

    assert head["tracks"] == ["belief", "hindsight"]
    assert [m["kind"] for m in head["marks"]] == ["lost", "stop"]
    assert head["marks"][1]["t"] == pytest.approx(0.7)
    assert [one["key"] for one in head["lanes"]] == ["error_m", "match"]
    assert np.isnan(arrays["lane1_v"][:9]).all()
    assert head["regions"][0]["name"] == "R1"
    assert arrays["scan0_ends"].shape == (2, N, 30)
    assert arrays["clouds_first"].tolist() == [0, 3, 5]
    x = head["origin"][0] + arrays["clouds_xy"][0] * head["point_m"]
    np.testing.assert_allclose(x, [0.0, 3.0, 6.0, 9.0, 12.0], atol=0.006)
    assert arrays["plans_xy"].shape == (2, 4)
    assert (replay.rows, replay.lanes) == (2, 2)
    ground = arrays["ground"]
    np.testing.assert_array_equal(np.unique(ground & 3), [1, 2])
    assert np.count_nonzero(ground & 8) == 15 * 30


def opens(post, states):
    """When the replay opens, of a log whose belief is off by 0.2 m at 1 s, 2 m at 3 s."""
    belief = post.belief.xyyaw - np.array([1.0, 0.0, 0.1])
    belief[10:20, 0] += 0.2
    belief[30:35, 0] += 2.0
    ends = START_NS + np.array([0, S, 2 * S, 4 * S])
    intervals = tuple(
        Interval(state, int(a), int(b)) for state, a, b in zip(states, ends, ends[1:], strict=False)
    )
    judgement = replace(post.judgement, intervals=intervals)
    shown = replace(post, belief=track(post.belief.t_ns, belief), judgement=judgement)
    return unpacked(replay_of(shown).payload)[0]["open_s"]


def test_opens_at_what_matters(post):
    assert opens(post, ["healthy", "map_changed", "lost"]) == pytest.approx(3.0, abs=0.5)
    assert 1.0 <= opens(post, ["healthy", "lost", "insufficient_data"]) < 2.0
    assert opens(post, ["healthy", "map_changed", "insufficient_data"]) == pytest.approx(1.9)
    assert opens(post, ["healthy", "healthy", "healthy"]) == 0.0


def test_opens_where_there_is_something_to_see(post):
    xyyaw = post.belief.xyyaw.copy()
    xyyaw[:5] = np.nan
    late = track(post.belief.t_ns, xyyaw)
    judgement = replace(
        post.judgement, intervals=(Interval("map_changed", START_NS, START_NS + 4 * S),)
    )
    shown = replace(post, belief=late, judgement=judgement)

    opened = unpacked(replay_of(shown).payload)[0]["open_s"]

    assert opened >= 0.5
    assert opened * S + START_NS in post.scene.scans[0].t_ns


def test_same_log_same_bytes(post):
    assert replay_of(post) == replay_of(replace(post))


def test_a_map_too_large_is_drawn_in_blocks_that_keep_thin_walls(monkeypatch):
    grid = room_grid()
    monkeypatch.setattr("slamreplay.report.replay.ground._MOST_CELLS", grid.cells.size // 12)
    ground = ground_of(grid, None)
    whole = np.zeros(np.array(ground.codes.shape) * ground.block, dtype=bool)
    whole[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.occupied
    blocks = whole.reshape(-1, ground.block, ground.codes.shape[1], ground.block)

    assert ground.block > 1
    np.testing.assert_array_equal(ground.codes == 2, blocks.any(axis=(1, 3)))
    assert ground.cell_m == pytest.approx(ground.block * grid.resolution_m)


def test_a_frame_offset_is_taken_out_and_told(post):
    offset = ConstantOffset((3.0, -1.0, np.pi / 2), 3.2, np.pi / 2, 0.1, "map")
    seen = replace(post.hindsight.track)
    off = replace(post, belief=replace(seen, xyyaw=se2.compose(np.array(offset.xyyaw), seen.xyyaw),
                  cov=post.belief.cov.copy()), frame_offset=offset)  # fmt: skip
    replay = replay_of(off)
    _, arrays = unpacked(replay.payload)

    np.testing.assert_allclose(arrays["belief_pose"], arrays["hindsight_pose"], atol=1)
    # Turned with the frame: long along y now.
    assert np.abs(np.cos(arrays["belief_ellipse"][2])).max() < 1e-3
    assert any("lies elsewhere" in note for note in replay.notes)


def test_another_map_before_is_not_drawn_in_the_last_one(post):
    held = Held(post.grid.version, START_NS + 2 * S, int(post.manifest.end_ns))
    last = Part(MapStretch((held,)), post.hindsight)
    later = replace(post, hindsight=replace(post.hindsight, parts=(last, last)))
    replay = replay_of(later)
    head, arrays = unpacked(replay.payload)

    for name in ("belief_t", "hindsight_t", "scan0_t"):
        assert (arrays[name].min() * head["tick_s"], len(arrays[name])) == (2.0, 20)
    assert arrays["lane0_t"][0] == 0  # the timeline is the whole log's
    assert any("Until 2.0 s" in note for note in replay.notes)


def test_marks_beyond_the_log_stand_at_its_edge(post):
    early = Mark("finding", START_NS - 3 * S, START_NS + 99 * S, "all along", "warning")
    head, _ = unpacked(replay_of(replace(post, scene=replace(post.scene, marks=(early,)))).payload)

    assert (head["marks"][0]["t"], head["marks"][0]["end"]) == (0.0, head["end_s"])


LACKING = {
    "map": {"grid": None},
    "hindsight": {"hindsight": None},
    "belief": {"belief": None},
    "map and hindsight": {"grid": None, "hindsight": None},
    "any path": {"belief": None, "hindsight": None},
}


@pytest.mark.parametrize("what", LACKING)
def test_what_the_log_lacks_is_left_out(post, what):
    lacking = replace(post, **LACKING[what])
    head, arrays = unpacked(replay_of(lacking).payload)

    assert (head["ground"] is None) == (what in ("map", "map and hindsight", "any path"))
    assert ("belief" in head["tracks"]) == (lacking.belief is not None)
    assert ("hindsight" in head["tracks"]) == (lacking.hindsight is not None)
    assert (head["window"] is None) == (what == "any path")
    assert ("scan0_t" in arrays) == (what != "any path")
    assert 0.0 <= head["open_s"] <= head["end_s"]


def test_odometry_alone_is_drawn_in_its_own_frame(post):
    alone = replace(post, belief=None, hindsight=None, odometry=post.belief)
    head, arrays = unpacked(replay_of(alone).payload)

    assert (head["tracks"], head["frame"]) == (["odometry"], "odom")
    assert head["ground"] is None
    assert head["regions"] == []
    assert "scan0_t" in arrays
    assert "clouds_t" not in arrays


def test_no_scans_and_one_scan(post):
    bare = replace(post.scene, scans=(), clouds=None, plans=None, marks=())
    head, _ = unpacked(replay_of(replace(post, scene=bare)).payload)
    assert head["lasers"] == []
    one = replace(post.scene, scans=(scans_of(1, 1),))
    _, arrays = unpacked(replay_of(replace(post, scene=one)).payload)
    assert arrays["scan0_met"].shape == (1, 1)


def test_nothing_to_show_is_no_replay(post, page_of):
    empty = replace(post.scene, scans=(), lanes=(), marks=())
    for nothing in (None, empty):
        without = replace(post, belief=None, hindsight=None, scene=nothing)
        assert replay_of(without) is None
    page = page_of(replace(post, scene=None))
    assert "<script" not in page
    assert "script-src" not in page


class _Scripts(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found, self.inside, self.styled = [], False, []

    def handle_starttag(self, tag, attrs):
        self.inside = tag == "script"
        if self.inside:
            self.found.append([dict(attrs), ""])
        self.styled += [name for name, _ in attrs if name == "style" or name.startswith("on")]

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.found[-1][1] += data


def test_no_text_of_a_log_leaves_the_payload(post, page_of):
    page = page_of(post)
    parser = _Scripts()
    parser.feed(page)
    data, module = parser.found

    assert data[0] == {"type": "application/octet-stream", "id": "replay-data"}
    assert re.fullmatch(r"[A-Za-z0-9+/=]+", data[1])
    assert unpacked(data[1])[0]["marks"][1]["title"] == SHOWN
    assert module[0] == {"type": "module"}
    assert "alert(1)" not in page
    assert parser.styled == []
    assert page_of(post) == page


def test_a_text_of_a_log_is_no_longer_than_a_screen_shows(post):
    long = replace(post.scene.marks[0], title="x" * 10_000)
    replay = replay_of(replace(post, scene=replace(post.scene, marks=(long,))))

    assert len(unpacked(replay.payload)[0]["marks"][0]["title"]) == 240


@pytest.mark.parametrize(
    ("n", "told"),
    [(2, "2nd"), (3, "3rd"), (4, "4th"), (11, "11th"), (21, "21st"), (113, "113th")],
)
def test_numbers_are_told_in_order(n, told):
    assert list(rows_left_out({"belief": n})) == [f"Every {told} pose of belief."]


def test_every_script_is_in_the_page():
    folder = files("slamreplay.report") / "templates" / "replay"

    assert sorted(f"replay/{f.name}" for f in folder.iterdir() if f.name.endswith(".js")) == sorted(
        _SCRIPTS
    )


def test_the_policy_lets_that_one_script_run(post, page_of):
    page = page_of(post)
    script = re.search(r'<script type="module">(.*?)</script>', page, re.DOTALL)[1]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1].replace("&#39;", "'")

    assert f"script-src 'sha256-{digest}'" in policy
    assert "unsafe" not in policy
    assert not re.search(r"\beval\b|new Function|innerHTML|outerHTML|insertAdjacentHTML", script)


def test_a_laser_that_took_no_part_in_hindsight_is_told(post):
    both = replace(post, scene=replace(post.scene, scans=(scans_of(), scans_of(seed=1))))
    one = BeamsMet(scans_of().t_ns, scans_of().met)

    def notes(*met):
        changes = replace(post.hindsight.changes, met=met)
        shown = replace(both, hindsight=replace(post.hindsight, changes=changes))
        return " ".join(replay_of(shown).notes)

    assert "Laser 2 took no part in hindsight" in notes(one)
    assert "took no part" not in notes(one, one)


def test_without_scans_none_are_promised(post):
    bare = replace(post, scene=replace(post.scene, scans=()))
    alone = replace(bare, belief=None, hindsight=None, odometry=post.belief)

    assert "scan" in replay_of(post).lead
    assert "scan" not in replay_of(bare).lead
    assert replay_of(alone).lead == "The path by odometry alone."
