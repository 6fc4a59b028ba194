"""What colours tell is told to eyes that see fewer of them: by colours far apart, or shapes."""

import itertools

import numpy as np
import pytest
from browser.pages import pixels
from browser.replay import Replay

KINDS = ("none", "deuteranopia", "protanopia", "tritanopia", "achromatopsia")
#: CIE 1976 colour difference; 2.3 is just noticeable side by side, this is seen at a glance.
APART = 15.0
#: Of what either of two drawings covers, the share that only one of them does: other shapes.
OTHER_SHAPE = 0.3
MET = ("mapped", "appeared", "removed", "moving", "other")
STATES = (
    "healthy", "lost", "map_changed", "lost_and_map_changed", "unobservable", "insufficient_data",
)  # fmt: skip


def lab(rgb):
    """CIE L*a*b* of sRGB under D65 (IEC 61966-2-1, CIE 15)."""
    linear = np.asarray(rgb, dtype=float) / 255.0
    linear = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    xyz = linear @ np.array(
        [[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]]
    )
    ratio = xyz / np.array([0.9505, 1.0, 1.089])
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def swatches(replay, kind, layers):
    """Of each layer's swatch, as seen by such eyes: its ink (3,) and where it is drawn.

    Also of layers that this log has no use for.
    """
    page = replay.page
    cdp = page.context.new_cdp_session(page)
    cdp.send("Emulation.setEmulatedVisionDeficiency", {"type": kind})
    selectors = [f"label[data-layer='{layer}']" for layer in layers]
    boxes = page.evaluate(
        """all => all.map(s => { const e = document.querySelector(s); e.hidden = false;
             e.style.display = 'flex'; return s }).map(s => {
             const b = document.querySelector(s + ' svg').getBoundingClientRect();
             const all = document.querySelector('.replay-layers').getBoundingClientRect();
             return [b.left - all.left, b.top - all.top, b.width, b.height].map(Math.round); })""",
        selectors,
    )
    picture = pixels(page.locator(".replay-layers")).astype(int)
    return [ink(picture[y : y + h, x : x + w]) for x, y, w, h in boxes]


def ink(picture):
    """The colour that most of what is drawn has (3,), and where anything is drawn (H, W)."""
    drawn = np.linalg.norm(picture - picture[0, 0], axis=-1) > 40
    colours, counts = np.unique(picture[drawn], axis=0, return_counts=True)
    return colours[np.argmax(counts)], drawn


def distances(one, other):
    """Colour difference, and how little the shapes cover each other (0 alike, 1 apart)."""
    apart = np.linalg.norm(lab(one[0]) - lab(other[0]))
    return round(float(apart), 1), round(
        float((one[1] ^ other[1]).sum() / (one[1] | other[1]).sum()), 2
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_beams_met_can_be_told_apart(show, scheme):
    replay = Replay(show("changed", color_scheme=scheme))
    alike = {}
    for kind in KINDS:
        found = dict(zip(MET, swatches(replay, kind, [f"met-{met}" for met in MET]), strict=True))
        for one, other in itertools.combinations(MET, 2):
            colour, shape = distances(found[one], found[other])
            # Colours alone are enough for eyes that see all of them: beams are small.
            if colour < APART and (kind == "none" or shape < OTHER_SHAPE):
                alike[kind, one, other] = colour, shape

    assert alike == {}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_belief_and_hindsight_can_be_told_apart(show, scheme):
    """By shape for all eyes and on paper, by colour as well for those that see any."""
    replay = Replay(show("lost", color_scheme=scheme))
    for kind in KINDS:
        for layers in (("belief", "hindsight"), ("scan-belief", "scan-hindsight")):
            colour, shape = distances(*swatches(replay, kind, layers))

            assert shape > OTHER_SHAPE
            assert colour > APART or kind == "achromatopsia"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_states_can_be_told_apart(show, scheme):
    """Bands are hatched as well: what is alike in colour differs in its pattern."""
    page = show("changed", color_scheme=scheme)
    page.evaluate(
        """states => { const box = document.createElement('div'); box.id = 'all-states';
             for (const s of states) box.insertAdjacentHTML('beforeend', `
               <svg width="48" height="24">
               <rect width="48" height="24" fill="url(#hatch-${s})"/></svg>`);
             document.querySelector('main').prepend(box); }""",
        STATES,
    )
    cdp = page.context.new_cdp_session(page)
    for kind in KINDS:
        cdp.send("Emulation.setEmulatedVisionDeficiency", {"type": kind})
        bands = [
            pixels(svg)[2:22, 2:46].astype(int) for svg in page.locator("#all-states svg").all()
        ]
        for one, other in itertools.combinations(range(len(STATES)), 2):
            colours = [lab(np.median(bands[k], axis=(0, 1))) for k in (one, other)]
            patterns = [hatched(bands[k]) for k in (one, other)]
            apart = np.linalg.norm(colours[0] - colours[1])
            differs = (patterns[0] != patterns[1]).mean()

            assert apart > APART or differs > 0.05, (kind, STATES[one], STATES[other])


def hatched(picture):
    """(H, W) where lines or dots lie over a band's own colour."""
    return np.linalg.norm(picture - np.median(picture, axis=(0, 1)), axis=-1) > 12
