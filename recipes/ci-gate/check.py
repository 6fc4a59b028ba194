"""Exit code 1 where a margin does not hold: python check.py RESULTS.json MARGINS.json."""

import json
import sys
from pathlib import Path

answer, demanded = (json.loads(Path(name).read_text(encoding="utf-8")) for name in sys.argv[1:3])
results = answer["results"]
bad = [] if results["controls_hold"] else ["a control failed: the answer says nothing"]
for perturbation, by_estimator in demanded.items():
    for estimator, level in by_estimator.items():
        curve = results["curves"].get(perturbation, {}).get(estimator)
        if curve is None or curve["reason"]:
            bad.append(f"{perturbation} with {estimator}: not tried")
            continue
        for metric, critical in curve["critical"].items():
            held, start = critical["low"], curve["baseline"]
            enough = held is not None and abs(held - start) >= abs(level - start)
            if critical["outcome"] == "always" or not enough:
                bad.append(f"{perturbation} with {estimator}: {metric} held at {held}, not {level}")
print("\n".join(bad) or "every margin holds")
sys.exit(bool(bad))
