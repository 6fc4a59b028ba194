"""From an incident to the bundle that everything is judged by, and to the truth beside it."""

from __future__ import annotations

from slamreplay.bench.incidents import Incident
from slamreplay.bench.truth import Truth, truth_of
from slamreplay.bundle.view import Bundle
from slamreplay.simulate.bundled import bundle_of as recorded_bundle


def bundle_of(incident: Incident) -> tuple[Bundle, Truth]:
    """The log of an incident as a bundle that lives in memory, and its labels."""
    bundle = recorded_bundle(incident.recording, incident.kind)
    return bundle, truth_of(incident, bundle)
