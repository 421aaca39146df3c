"""Sums that keep what rounding drops."""

from __future__ import annotations

from earth._jit import formula


@formula
def compensated_sum(total, lost, term):
    """Kahan's step: return the new sum and what it lost."""
    y = term - lost
    new = total + y
    return new, (new - total) - y


@formula
def compensated_sums(totals, lost, terms):
    """Return the new triple of sums and what they lost."""
    x, lost_x = compensated_sum(totals[0], lost[0], terms[0])
    y, lost_y = compensated_sum(totals[1], lost[1], terms[1])
    z, lost_z = compensated_sum(totals[2], lost[2], terms[2])
    return (x, y, z), (lost_x, lost_y, lost_z)
