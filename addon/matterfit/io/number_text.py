# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as people read them: to the digits that their error leaves, and never as -0."""

import math


def signed(text):
    """A number's text without the sign that rounding leaves to a zero: -0.00 as 0.00."""
    return text.removeprefix("-") if float(text) == 0.0 else text


def short(value, digits=4):
    """A value with so many digits at most: 0.25, 2.943e+07."""
    return signed(f"{value:.{digits}g}")


def rounded(value, error):
    """A value to the two digits of its error: 232100."""
    if not _is_known(error):
        return short(value)
    digits = 1 - math.floor(math.log10(error))
    largest = max(abs(value), error)
    if largest >= 1e6 or digits > 6:
        return short(value, math.floor(math.log10(largest)) + digits + 1)
    return _fixed(value, digits)


def value_text(value, error=None, unit=""):
    """A value with its error to two digits: 294300 ± 1200 Pa, (2.943 ± 0.012)e7 Pa."""
    unit = f" {unit}" if unit else ""
    if not _is_known(error):
        return f"{short(value, 6)}{unit}"
    power = math.floor(math.log10(max(abs(value), error)))
    if -4 < power < 6:
        power = 0
    scaled, scaled_error = value / 10.0**power, error / 10.0**power
    digits = 1 - math.floor(math.log10(scaled_error))
    text = f"{_fixed(scaled, digits)} ± {_fixed(scaled_error, digits)}"
    return f"({text})e{power}{unit}" if power else f"{text}{unit}"


def percent(share):
    """A share in whole per cent: 82 %."""
    return signed(f"{100.0 * share:.0f}") + " %"


def grouped(count):
    """A whole number in groups of three digits: 114 865."""
    return f"{count:,}".replace(",", " ")


def with_prefix(value, unit):
    """Two digits of a value with the prefix of its unit: 91 kPa, 4 MPa/m."""
    value = float(f"{value:.2g}")
    for prefix, size in (("G", 1e9), ("M", 1e6), ("k", 1e3), ("", 1.0), ("m", 1e-3), ("µ", 1e-6)):
        if abs(value) >= size:
            return f"{value / size:.3g} {prefix}{unit}"
    return f"{short(value)} {unit}"


def _is_known(error):
    return bool(error) and math.isfinite(error) and error > 0.0


def _fixed(value, digits):
    """A value with so many digits behind the point; below 0 those before it are rounded."""
    return signed(f"{round(value, digits):.{max(digits, 0)}f}")
