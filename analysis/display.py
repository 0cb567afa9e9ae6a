"""Numbers as readers see them: every displayed string of the analysis is made here.

Percentages of counts are rounded half-up on the exact fraction, never on a binary float: 158 of
840 is 18.8 %, and 1 of 8 is 12.5 %, whatever a float would say.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

DASH = "–"


def round_half_up(value: Fraction | float, digits: int) -> str:
    """Decimal string of `value` with `digits` places, ties away from zero."""
    exact = Fraction(value) if not isinstance(value, Fraction) else value
    scaled = abs(exact) * 10**digits
    whole = (2 * scaled.numerator + scaled.denominator) // (2 * scaled.denominator)
    sign = "-" if exact < 0 and whole else ""
    with localcontext() as context:
        context.prec = 60
        text = f"{Decimal(whole).scaleb(-digits):f}"
    return sign + text


def percent(value: Fraction | float, digits: int = 1) -> str:
    """A share in [0, 1] as a percentage without its sign: `percent(Fraction(570, 840)) == "67.9"`."""
    exact = value if isinstance(value, Fraction) else Fraction(Decimal(repr(float(value))))
    return round_half_up(exact * 100, digits)


def percent_interval(bounds: tuple[float, float] | list[float], digits: int = 1) -> str:
    """Two shares as `64.6–71.0`."""
    return f"{percent(bounds[0], digits)}{DASH}{percent(bounds[1], digits)}"


def p_value(value: float) -> str:
    """A probability for reading: three decimals, two significant digits below 0.01, `<0.0001` at the end."""
    if value < 0.0001:
        return "<0.0001"
    if value < 0.01:
        return f"{Decimal(f'{value:.1e}'):f}"
    return round_half_up(Fraction(Decimal(repr(float(value)))), 3)


def fixed(value: float | None, digits: int = 2) -> str:
    """A plain number, or a dash where there is none."""
    if value is None:
        return DASH
    return round_half_up(Fraction(Decimal(repr(float(value)))), digits).replace("-", "−")


def span(low: int | str, high: int | str, between: str = " to ") -> str:
    """`60 to 64`, or `64` where both ends are the same."""
    return str(low) if low == high else f"{low}{between}{high}"


def holding(count: int, singular: str, plural: str | None = None) -> str:
    """`1 answer`, `2 answers`."""
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"
