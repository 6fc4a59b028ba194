"""Whether a log's clocks, transforms and numbers hold together: measured here, judged above.

It reads bundles only, so that `inspect` and the checks of consistency say the same.
"""
