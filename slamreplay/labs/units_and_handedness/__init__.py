"""Every confusion of units, hands and frames on a healthy log: what breaks, and who finds it."""
