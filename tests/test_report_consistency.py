"""The consistency section: its numbers are the checks', and its bands hold what is consistent."""

from dataclasses import replace

import numpy as np
import pytest
from beliefs import APART, COUPLED, ar1, context

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.answers import raised
from slamreplay.consistency.asking import answered
from slamreplay.consistency.belief.summary import consistency_summaries
from slamreplay.consistency.evidence.source import Reference
from slamreplay.consistency.statistics.distribution import distribution
from slamreplay.report import consistency_tables
from slamreplay.report.figures import canvas
from slamreplay.report.figures.consistency import bar_band, consistency_figure, drawn_parts
from slamreplay.testing import believed

NAMES = ("credibility_index", "distribution", "nees")


def summaries(made):
    return consistency_summaries(made, answered([made], NAMES))


@pytest.fixture(scope="module")
def bold():
    """A belief that claims a third of its sigma, against a reference and against hindsight."""
    made = context(3.0 * ar1(np.random.default_rng(2), 400, 0.5, 3), APART)
    rebuilt = made.references[0].track
    rebuilt = PoseTrack.without_covariance(
        "map", "base", rebuilt.t_ns, rebuilt.xyyaw + np.array([0.01, 0.0, 0.0])
    )
    shared = Reference("hindsight", "hindsight", rebuilt)
    return replace(made, references=(*made.references, shared))


def test_the_table_says_what_the_finding_says(bold):
    answers = answered([bold], NAMES)
    found = [f for f in raised(answers) if f.id == "SR-CON-001"]
    rows = summaries(bold)

    assert [(s.shared, [p.name for p in s.parts]) for s in rows] == [
        (False, ["position", "heading"]),
        (True, ["position", "heading"]),
    ]
    for finding, part in zip(found, rows[0].parts, strict=True):
        assert part.mean.mean == finding.value
        assert (part.mean.low, part.mean.high) == (finding.low, finding.high)
        assert part.mean.p_value == finding.p_value
        assert part.p_adjusted == finding.p_adjusted
    # Of hindsight nothing was tested that could accuse or clear.
    assert rows[1].parts[0].p_adjusted is None


def test_cells_are_what_a_reader_acts_on(bold):
    rows = summaries(bold)
    means, held = consistency_tables.means(rows), consistency_tables.coverage(rows)

    assert [c.text for c in means.rows[0]][1] == "position"
    assert means.rows[0][0].aside == "independent"
    assert means.rows[2][0].aside == "shares its evidence"
    assert means.rows[0][2].aside == "2 expected"
    assert 2.7 < float(means.rows[0][4].text) < 3.3  # k
    assert means.rows[2][-1].text == "-"
    assert len(held.head) == len(held.rows[0]) == 11
    assert float(held.rows[0][2].text.split()[0]) < 20  # of the 50 % ellipse
    assert held.rows[0][-1].text.startswith("+9")
    assert "never clears it" in consistency_tables.note(rows)


def test_figure_and_its_words_in_two_widths(bold):
    rows = summaries(bold)
    with canvas.plain_style():
        wide = canvas.svg_bytes(consistency_figure(rows, canvas.WIDE))
        again = canvas.svg_bytes(consistency_figure(rows, canvas.WIDE))
        narrow = canvas.svg_bytes(consistency_figure(rows, canvas.NARROW))

    assert wide == again
    assert wide != narrow
    for words in (b"position: F(NEES) [1]", b"heading: F(NEES) [1]", b"claimed by the ellipse"):
        assert words in wide
        assert words in narrow
    assert "% within the 50 % ellipse" in consistency_tables.alt(rows)
    assert "simulation /truth" in consistency_tables.alt(rows)


def test_a_coupled_belief_is_drawn_as_one(bold):
    rows = summaries(context(np.random.default_rng(1).standard_normal((60, 3)), COUPLED))

    assert [name for name, _ in drawn_parts(rows)] == ["pose"]
    with canvas.plain_style():
        assert b"pose: F(NEES) [1]" in canvas.svg_bytes(consistency_figure(rows, canvas.WIDE))


def test_without_errors_there_is_nothing_to_show():
    made = believed(0)
    alone = replace(made, references=())
    elsewhere = replace(
        made,
        references=(Reference("survey", "/lab", made.references[0].track.take(np.arange(0))),),
    )

    assert summaries(alone) == ()
    assert summaries(elsewhere) == ()
    assert consistency_figure((), canvas.WIDE) is None
    assert consistency_tables.means(()).rows == ()
    assert consistency_tables.alt(()) == ""


@pytest.mark.parametrize(("rho", "n"), [(0.0, 400), (0.8, 300)])
def test_bars_and_curve_of_consistent_beliefs_lie_within_their_bands(rho, n):
    bars_in = curve_in = 0
    for seed in range(150):
        found = distribution(ar1(np.random.default_rng([seed, 5]), n, rho, 2))
        bars = 10 if found.n_eff >= 50 else 5
        low, high = bar_band(bars, found.n_eff)
        share = np.histogram(found.pit, bars, (0.0, 1.0))[0] / found.n
        bars_in += bool(((low <= share) & (share <= high)).all())
        curve_in += found.distance <= found.most

    assert bars_in >= 135  # 95 % of 150 are 142, with a standard deviation of 3
    assert curve_in >= 135
