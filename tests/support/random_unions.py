"""Random bodies for property-based tests: unions of boxes and prisms, whole and as files have them.

Sizes and places are whole centimetres and turns most often quarters, so that parts touch, share
planes, stand on each other and are doubled as often as they overlap.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import shapely
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array
from tests.support.convex_polyhedra import prism
from tests.support.solids import regular_polygon

CM = 0.01


class Body(NamedTuple):
    """Closed, outward-oriented shells (T, 3, 3) [m], and what careless software makes of each."""

    solids: list[Array]
    raw: list[Array]


def _profile(sides: int, radius: float, notched: bool) -> shapely.Polygon:
    profile = shapely.box(-radius, -radius, radius, radius)
    if sides != 4:
        profile = regular_polygon(sides, radius)
    return profile - shapely.box(-radius / 4, 0, radius / 4, 2 * radius) if notched else profile


def _turn(kind: str, number: int) -> Array:
    if kind == "any":
        return Rotation.random(random_state=number).as_matrix()
    angle = {"quarter": 90, "eighth": 45}[kind]
    axis = "xyz"[number % 3]
    return Rotation.from_euler(axis, angle * (number // 3), degrees=True).as_matrix()


@st.composite
def solids(draw: st.DrawFn) -> Array:
    """A box or a prism, concave now and then."""
    profile = _profile(
        draw(st.sampled_from([4, 4, 3, 5, 6, 8])),
        draw(st.integers(1, 4)) * CM,
        draw(st.sampled_from([False, False, True])),
    )
    stretch = np.array([draw(st.integers(1, 3)), 1, 1])
    R = _turn(
        draw(st.sampled_from(["quarter", "quarter", "eighth", "any"])), draw(st.integers(0, 11))
    )
    p = np.array(draw(st.tuples(*[st.integers(-4, 4)] * 3))) * CM
    return (prism(profile, draw(st.integers(1, 8)) * CM) * stretch) @ R.T + p


def _double(part: Array, rng: np.random.Generator) -> Array:
    return np.concatenate([part, part[rng.choice(len(part), 2)]])


def _flip(part: Array, rng: np.random.Generator) -> Array:
    turned = part.copy()
    k = rng.choice(len(part), 2)
    turned[k] = turned[k, ::-1]
    return turned


def _reverse(part: Array, _: np.random.Generator) -> Array:
    return part[:, ::-1]


def _mix(part: Array, rng: np.random.Generator) -> Array:
    return np.where(rng.random(len(part))[:, None, None] < 0.5, part, part[:, ::-1])


def _jitter(part: Array, rng: np.random.Generator) -> Array:
    vertices, index = np.unique(part.reshape(-1, 3), axis=0, return_inverse=True)
    size = 10 ** rng.uniform(-9, -6) * np.ptp(vertices, axis=0).max()
    vertices = vertices + size * rng.uniform(-1, 1, vertices.shape)
    return np.asarray(vertices[index.reshape(-1, 3)])


def _split(part: Array, rng: np.random.Generator) -> Array:
    k = rng.integers(len(part))
    a, b, c = part[k]
    middle = rng.dirichlet([2, 2, 2]) @ part[k]
    new = np.array([[a, b, middle], [b, c, middle], [c, a, middle]])
    return np.concatenate([np.delete(part, k, axis=0), new])


def _t_junction(part: Array, rng: np.random.Generator) -> Array:
    k = rng.integers(len(part))
    a, b, c = np.roll(part[k], rng.integers(3), axis=0)
    middle = a + rng.uniform(0.2, 0.8) * (b - a)  # The neighbour across ab keeps its side whole.
    return np.concatenate([np.delete(part, k, axis=0), [[a, middle, c], [middle, b, c]]])


DAMAGES: dict[str, Callable[[Array, np.random.Generator], Array]] = {
    "double": _double,
    "flip": _flip,
    "reverse": _reverse,
    "mix": _mix,
    "jitter": _jitter,
    "split": _split,
    "T-junction": _t_junction,
}


@st.composite
def bodies(draw: st.DrawFn, most: int) -> Body:
    """A union of up to `most` solids, and the same with up to four damages."""
    whole = draw(st.lists(solids(), min_size=1, max_size=most))
    raw = list(whole)
    for kind in draw(st.lists(st.sampled_from(sorted(DAMAGES)), max_size=4)):
        k = draw(st.integers(0, len(raw) - 1))
        rng = np.random.default_rng(draw(st.integers(0, 1000)))
        raw[k] = DAMAGES[kind](raw[k], rng)
    return Body(whole, raw)
