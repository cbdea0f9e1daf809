"""Files of `raylane bench --json`, and the means that figures and tables show.

Means come with half the width of the 95 % confidence interval, after Student; ratios are formed
within each round and then averaged, as in src/bench/statistics.zig.
"""

import json
import math

FORMAT = "raylane-bench-1"
# Student's t for 95 % in the middle, by degrees of freedom.
T_TABLE = [12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281,
           2.2010, 2.1788, 2.1604, 2.1448, 2.1314, 2.1199, 2.1098, 2.1009, 2.0930, 2.0860,
           2.0796, 2.0739, 2.0687, 2.0639, 2.0595, 2.0555, 2.0518, 2.0484, 2.0452, 2.0423]


class Unusable(Exception):
    """A file that is not what it should be, in one line."""


def load(path):
    """One run; raises `Unusable`."""
    try:
        with open(path, encoding="utf-8") as file:
            run = json.load(file)
    except (OSError, ValueError) as error:
        raise Unusable(f"{path}: {error}") from error
    if not isinstance(run, dict) or run.get("format") != FORMAT:
        raise Unusable(f"{path}: is no file of raylane bench --json")
    if not run.get("scenes"):
        raise Unusable(f"{path}: holds no scenes")
    return run


def quantile(freedom):
    """Student's t; beyond the table by the expansion around the normal quantile."""
    if freedom <= len(T_TABLE):
        return T_TABLE[freedom - 1]
    z = 1.959964
    return z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)


def estimate(samples):
    """(mean, half width) of numbers; the half width of one is None; None of none."""
    if not samples:
        return None
    count = len(samples)
    mean = sum(samples) / count
    if count == 1:
        return mean, None
    squares = sum((sample - mean) ** 2 for sample in samples)
    return mean, quantile(count - 1) * math.sqrt(squares / (count - 1) / count)


def ratio(numerators, denominators):
    """The mean of the quotients of each round; None where there is none or one is 0."""
    pairs = list(zip(numerators, denominators))
    if not pairs or any(lower == 0 for _, lower in pairs):
        return None
    return estimate([upper / lower for upper, lower in pairs])


def rate(work, samples):
    """The mean of work a sample."""
    return ratio([work] * len(samples), samples)


def scaled(value, factor):
    """An estimate times a number."""
    if value is None:
        return None
    return value[0] * factor, None if value[1] is None else value[1] * factor


def short(scene):
    """A scene's name for headings."""
    return scene.removeprefix("builtin:").rsplit("/", 1)[-1]


def render_ratio(scene, variant):
    """Render time of the reference over that of a variant."""
    return ratio(scene["variants"][0]["trace_ms"], variant["trace_ms"])


def build_ratio(scene, variant):
    """The same of building the BVH."""
    return ratio(scene["variants"][0]["bvh_build_ms"], variant["bvh_build_ms"])


def tests_rate(kind):
    """Millions of tests a second, of `box` or `triangle`; idle lanes count, as in the thesis."""
    return lambda scene, variant: rate(variant["tests"][f"{kind}_issued"] * 1e-3,
                                       variant["trace_ms"])


def tests_ratio(kind):
    """That over the reference's."""
    def of(scene, variant):
        reference = scene["variants"][0]["tests"][f"{kind}_issued"]
        if reference == 0:
            return None
        return scaled(render_ratio(scene, variant),
                      variant["tests"][f"{kind}_issued"] / reference)
    return of


def rays_rate(kind):
    """Millions of rays a second; `kind` as in the file."""
    return lambda scene, variant: rate(scene["rays"][kind] * 1e-3, variant["trace_ms"])


def boxes_per_triangle(_, variant):
    """How well the BVH keeps rays from triangles."""
    triangles = variant["tests"]["triangle_issued"]
    return (variant["tests"]["box_issued"] / triangles, None) if triangles else None


def energy(which):
    """Joules a frame, `whole_j` or `trace_j`."""
    return lambda scene, variant: estimate((variant["energy"] or {}).get(which))


def energy_ratio(which):
    """The reference's joules over a variant's."""
    def of(scene, variant):
        reference = scene["variants"][0]["energy"]
        if reference is None or variant["energy"] is None:
            return None
        return ratio(reference[which], variant["energy"][which])
    return of


def rays_per_joule(which):
    """Thousands of rays of all kinds."""
    def of(scene, variant):
        if variant["energy"] is None:
            return None
        return rate(sum(scene["rays"].values()) * 1e-3, variant["energy"][which])
    return of


def has_energy(run):
    """Whether any energy was measured."""
    return any(variant["energy"] for scene in run["scenes"] for variant in scene["variants"])
