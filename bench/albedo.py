#!/usr/bin/env python3
"""Fits the directional albedo of GGX: the coefficients of src/trace/shade/albedo.zig.

    bench/albedo.py

The albedo is integrated over the visible normals (Dupuy and Benyoub 2023) on a fixed grid, and two
functions of cosine and alpha are fitted to it by rational ones: E, the albedo where nothing is
absorbed, and m, the cosine for which Schlick's approximation gives the albedo of a dielectric.
Rational least squares (Sanathanan and Koerner 1963), then Levenberg-Marquardt with weights that
grow where the error is large (Lawson 1961), towards the least maximum of the relative error.
Prints both errors and the coefficients. Needs numpy; a minute.
"""

import numpy as np

MISSING_NUMERATOR = [(0, 2), (0, 3), (0, 4), (0, 5)]
MISSING_DENOMINATOR = [(0, 0), (0, 1), (0, 2), (0, 3)]
SCHLICK_NUMERATOR = [(0, 0), (0, 1), (0, 2), (0, 3)]
SCHLICK_DENOMINATOR = [(0, 0), (0, 1), (0, 2)]
ROUGHNESS = np.concatenate([[0.03], np.arange(0.05, 0.5, 0.025), np.arange(0.5, 1.001, 0.05)])
F0 = 0.04
# Exponents of cosine and alpha in numerators and denominators; the first of these has factor 1.
E_NUMERATOR = [(i, j) for i in (1, 2) for j in (1, 2, 3, 4)]
E_DENOMINATOR = [(2, 0)] + [(i, j) for i in range(4) for j in range(4)
                            if i + j >= 2 and (i, j) != (2, 0)]
M_NUMERATOR = [(0, 2), (0, 3), (0, 4)] + [(i, j) for i in (1, 2, 3) for j in (1, 2, 3)]
M_DENOMINATOR = [(1, 0), (1, 1), (1, 2), (0, 1), (0, 2), (0, 3), (2, 0), (2, 1), (2, 2)]


def albedo(cosine, alpha, shape=(128, 128)):
    """E, and the part of it that Schlick's (1 - cosine)^5 weighs, by integration."""
    u, v = np.meshgrid(*((np.arange(n) + 0.5) / n for n in shape))
    # Dense at the edge of the cap, where the steep microfacets are.
    share, v = 4 * (1 - v) ** 3, 1 - (1 - v) ** 4
    sine = np.sqrt(1 - cosine * cosine)
    length = np.hypot(alpha * sine, cosine)
    x, z = alpha * sine / length, cosine / length
    cap_z = (1 - v) * (1 + z) - z
    cap_r = np.sqrt(np.clip(1 - cap_z * cap_z, 0, 1))
    half = np.array([(cap_r * np.cos(2 * np.pi * u) + x) * alpha,
                     cap_r * np.sin(2 * np.pi * u) * alpha, cap_z + z])
    half /= np.sqrt((half * half).sum(0))
    view_half = sine * half[0] + cosine * half[2]
    light = 2 * view_half * half[2] - cosine
    above = light > 0
    light = np.where(above, light, 1)

    def smith(c):
        return (np.sqrt(1 + alpha * alpha * (1 - c * c) / (c * c)) - 1) / 2

    weight = share * np.where(above, (1 + smith(cosine)) / (1 + smith(cosine) + smith(light)), 0)
    grazing = (1 - np.clip(view_half, 0, 1)) ** 5
    return weight.mean(), (weight * grazing).mean()


def samples():
    """Rows of cosine, alpha, E and its grazing part: denser where cosine is about alpha."""
    rows = []
    for roughness in ROUGHNESS:
        alpha = roughness * roughness
        cosines = np.concatenate([np.linspace(0, 1, 30) ** 1.5, alpha * np.geomspace(0.02, 20, 24)])
        for cosine in np.unique(np.clip(cosines, 1e-6, 1)):
            rows.append((cosine, alpha, *albedo(cosine, alpha)))
    return np.array(rows).T


class Rational:
    """Sum of numerator terms over the first denominator term plus a sum of the others."""

    def __init__(self, numerator, denominator, cosine, alpha):
        def terms(exponents):
            return np.stack([cosine ** i * alpha ** j for i, j in exponents], 1)
        self.count = len(numerator)
        self.above, self.below = terms(numerator), terms(denominator[1:])
        self.first = terms(denominator[:1])[:, 0]
        self.factors = None

    def evaluate(self, factors):
        below = self.first + self.below @ factors[self.count:]
        return self.above @ factors[:self.count] / below, below

    def linear(self, target, weight, rounds=60):
        """Least squares of the equation times the denominator of the round before."""
        below, lawson, least = np.ones_like(target), np.ones_like(target), np.inf
        for step in range(rounds):
            scale = (weight * lawson / below)[:, None]
            matrix = np.concatenate([self.above, -self.below * target[:, None]], 1) * scale
            right = self.first * target * scale[:, 0]
            factors = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
            value, below = self.evaluate(factors)
            error = np.abs(value - target) * weight
            if error.max() < least and below.min() > 0:
                least, self.factors = error.max(), factors
            below = np.where(np.abs(below) < 1e-6, 1e-6, below)
            if step > 5:
                lawson *= (0.3 + error / error.max()) ** 0.3
                lawson /= lawson.mean()

    def refine(self, target, weight, rounds=800):
        """Levenberg-Marquardt; keeps the factors of the least maximum."""
        factors, damping, lawson, least = self.factors, 1e-3, np.ones_like(target), np.inf
        value, below = self.evaluate(factors)
        for _ in range(rounds):
            rest = (target - value) * weight
            if np.abs(rest).max() < least:
                least, self.factors = np.abs(rest).max(), factors
            lawson *= (0.2 + np.abs(rest) / np.abs(rest).max()) ** 0.1
            lawson /= lawson.mean()
            scale = (weight * lawson / below)[:, None]
            slope = np.concatenate([self.above, -self.below * value[:, None]], 1) * scale
            normal, gradient = slope.T @ slope, slope.T @ (rest * lawson)
            cost = ((rest * lawson) ** 2).sum()
            for _ in range(8):
                diagonal = np.diag(np.diag(normal) + 1e-14)
                changed = factors + np.linalg.solve(normal + damping * diagonal, gradient)
                value_changed, below_changed = self.evaluate(changed)
                rest_changed = (target - value_changed) * weight * lawson
                if below_changed.min() > 0 and (rest_changed ** 2).sum() < cost:
                    factors, value, below = changed, value_changed, below_changed
                    damping = max(damping / 4, 1e-9)
                    break
                damping = min(damping * 4, 1e6)
        return least


def fit(name, exponents, cosine, alpha, target, weight):
    rational = Rational(*exponents, cosine, alpha)
    rational.linear(target, weight)
    error = rational.refine(target, weight)
    print(f"{name}: largest weighted error {error:.4f}")
    factors = np.insert(rational.factors, rational.count, 1)
    for title, part, power in (("numerator", exponents[0], factors[:rational.count]),
                               ("denominator", exponents[1], factors[rational.count:])):
        for i in sorted({i for i, _ in part}):
            row = {j: factor for (k, j), factor in zip(part, power) if k == i}
            print(f"    {title} cosine^{i}: " +
                  " + ".join(f"{row[j]:.7g} alpha^{j}" for j in sorted(row)))
    return rational


def value_of(rational, exponents, cosine, alpha):
    other = Rational(*exponents, cosine, alpha)
    return other.evaluate(rational.factors)[0]


def averages(e_fit, m_fit):
    """Cosine-weighted means of what was fitted, as polynomials of alpha."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    cosine = (nodes / 2 + 0.5) ** 2  # Denser at grazing angles.
    weights = weights / 2 * 2 * np.sqrt(cosine)
    roughness = np.linspace(0.03, 1, 98)
    means = []
    for alpha in roughness ** 2:
        alphas = np.full_like(cosine, alpha)
        e = 1 - np.maximum(value_of(e_fit, (E_NUMERATOR, E_DENOMINATOR), cosine, alphas), 0)
        m = cosine + value_of(m_fit, (M_NUMERATOR, M_DENOMINATOR), cosine, alphas)
        means.append([(2 * cosine * f * weights).sum() for f in (e, e * (1 - m) ** 5)])
    e, grazing = np.array(means).T
    alpha = roughness ** 2
    one = np.ones_like(alpha)
    # As exact as light scattered more than once needs it: 7 % where there is little, else 2 %.
    weight = (1.1 - e) / (1.0005 - e)
    fit("1 - mean of E", (MISSING_NUMERATOR, MISSING_DENOMINATOR), one, alpha, 1 - e, weight)
    exponents = (SCHLICK_NUMERATOR, SCHLICK_DENOMINATOR)
    fit("mean of Schlick's weight", exponents, one, alpha, grazing / e, 21 * one)


def main():
    cosine, alpha, e, grazing = samples()
    exponents = (E_NUMERATOR, E_DENOMINATOR)
    e_fit = fit("1 - E", exponents, cosine, alpha, 1 - e, 1 / e)
    dielectric = F0 * (e - grazing) + grazing
    m = 1 - np.maximum(grazing / e, 1e-12) ** 0.2
    weight = 5 * (1 - F0) * (1 - m) ** 4 * e / dielectric
    exponents = (M_NUMERATOR, M_DENOMINATOR)
    m_fit = fit("m - cosine", exponents, cosine, alpha, m - cosine, np.maximum(weight, 5e-4))
    averages(e_fit, m_fit)


if __name__ == "__main__":
    main()
