"""Numbers as a laboratory writes them down."""

from __future__ import annotations


def four_digits(value: float) -> float:
    """Four digits: what lies beyond is of no use, and differs between machines."""
    return float(f"{value:.4g}")
