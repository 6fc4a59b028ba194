"""Root causes: which single thing, put into evidence that was healed, reproduces what was seen."""
