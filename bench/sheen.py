#!/usr/bin/env python3
"""Fits the directional albedo of Charlie's sheen: the coefficients of src/trace/shade/sheen.zig.

    bench/sheen.py

The albedo is integrated over the hemisphere, its negative logarithm is fitted by a rational
function of cosine and roughness: where the lobe is narrow the albedo falls as a Gaussian. Least
squares of the equation times the denominator (Sanathanan and Koerner 1963) in steps that keep the
denominator positive, then the refinement of bench/albedo.py. The error is that of the albedo over
itself, or over 0.1 where it is less. Prints the largest one, also of points between those that are
fitted, and the coefficients. Needs numpy; half a minute.
"""

import numpy as np

from albedo import Rational

COSINE_LEAST = 0.01
ROUGHNESS_LEAST = 0.05
SMALL = 0.1
# Exponents of cosine and roughness; the first of the denominator has factor 1.
NUMERATOR = [(i, j) for i in range(4) for j in range(5)]
DENOMINATOR = [(i, j) for i in range(3) for j in range(4)]
NODES, WEIGHTS = (part / 2 for part in np.polynomial.legendre.leggauss(96))


def visibility_lambda(cosine, alpha):
    """Smith's auxiliary function by Estevez and Kulla's fit."""
    share = (1 - alpha) ** 2
    a, b, c, d, e = (rough * (1 - share) + smooth * share for rough, smooth in (
        (21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801),
        (-1.97760, -1.27393), (-4.32054, -4.85967)))

    def logarithm(x):
        return a / (1 + b * x ** c) + d * x + e
    low, high = np.minimum(cosine, 0.5), np.maximum(cosine, 0.5)
    return np.exp(np.where(cosine < 0.5, logarithm(low),
                           2 * logarithm(0.5) - logarithm(1 - high)))


def albedo(cosine, roughness, turns=96):
    """Share of white light that the lobe sends to a view, by integration."""
    alpha = roughness * roughness
    # Dense at the horizon and around the view's azimuth.
    light = ((NODES + 0.5) ** 3)[:, None]
    weight = WEIGHTS * 3 * (NODES + 0.5) ** 2
    share = (np.arange(turns) + 0.5) / turns
    across = np.sqrt((1 - cosine * cosine) * (1 - light * light)) * np.cos(np.pi * share ** 2)
    half = (cosine + light) ** 2 / (2 + 2 * (across + cosine * light))
    density = (2 + 1 / alpha) / (2 * np.pi) * np.exp(0.5 / alpha * np.log1p(-half))
    light = light[:, 0]
    view = max(cosine, COSINE_LEAST)
    lit = np.maximum(light, COSINE_LEAST)
    shadowing = 1 + visibility_lambda(view, alpha) + visibility_lambda(lit, alpha)
    mean = (density * 2 * share).mean(1)
    return (2 * np.pi * weight * mean * light / (4 * view * lit * shadowing)).sum()


def samples(cosines, roughnesses):
    """Columns of cosine, roughness and albedo."""
    return np.array([(c, r, albedo(c, r)) for r in roughnesses for c in cosines]).T


def start(rational, target, weight, rounds=60):
    """Least squares times the denominator before, no further than that stays positive."""
    factors = np.linalg.lstsq(rational.above * weight[:, None], target * weight, rcond=1e-12)[0]
    factors = np.append(factors, np.zeros(rational.below.shape[1]))
    rational.factors, least = factors, np.inf
    below = rational.evaluate(factors)[1]
    for _ in range(rounds):
        scale = weight / below
        matrix = np.concatenate([rational.above, -rational.below * target[:, None]], 1)
        # Damped: sums of powers are nearly dependent on each other.
        matrix = np.vstack([matrix * scale[:, None], 1e-4 * np.eye(len(factors))])
        right = np.append(rational.first * target * scale, 1e-4 * factors)
        step = np.linalg.lstsq(matrix, right, rcond=None)[0] - factors
        for length in (1, 0.5, 0.25, 0.1, 0.03):
            value, below_changed = rational.evaluate(factors + length * step)
            if below_changed.min() > 0:
                break
        else:
            return
        factors, below = factors + length * step, below_changed
        error = (np.abs(value - target) * weight).max()
        if error < least:
            least, rational.factors = error, factors


def largest_error(factors, cosine, roughness, wanted):
    value, below = Rational(NUMERATOR, DENOMINATOR, cosine, roughness).evaluate(factors)
    error = np.abs(np.exp(-value) - wanted) / np.maximum(wanted, SMALL)
    return error.max(), below.min()


def main():
    cosine, roughness, wanted = samples(
        np.concatenate([np.geomspace(COSINE_LEAST, 0.2, 24), np.linspace(0.22, 1, 27)]),
        np.concatenate([np.linspace(ROUGHNESS_LEAST, 0.3, 26), np.linspace(0.32, 1, 24)]))
    rational = Rational(NUMERATOR, DENOMINATOR, cosine, roughness)
    # Where there is none the value hardly counts, but the denominator is to be positive.
    target = -np.log(np.maximum(wanted, 1e-9))
    weight = np.clip(wanted / SMALL, 1e-5, 1)
    start(rational, target, weight)
    rational.refine(target, weight, 3000)
    print("largest error: %.4f, least denominator %.2g" %
          largest_error(rational.factors, cosine, roughness, wanted))
    between = samples(np.geomspace(COSINE_LEAST, 1, 61), np.geomspace(ROUGHNESS_LEAST, 1, 37))
    print("between: %.4f, least denominator %.2g" % largest_error(rational.factors, *between))
    factors = np.insert(rational.factors, rational.count, 1)
    for title, exponents, part in (("numerator", NUMERATOR, factors[:rational.count]),
                                   ("denominator", DENOMINATOR, factors[rational.count:])):
        for i in sorted({i for i, _ in exponents}):
            row = [f"{factor:.7g}" for (k, _), factor in zip(exponents, part) if k == i]
            print(f"    {title} cosine^{i}: " + ", ".join(row))


if __name__ == "__main__":
    main()
