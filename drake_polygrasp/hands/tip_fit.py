"""Measures how well the sphere of a fingertip fits the collision geometry that it stands for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.geometry import (
    GeometryId,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    SceneGraphInspector,
    Sphere,
)
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, unit

_NUM_POINTS = 200
_CAP = np.deg2rad(60.0)
"""The part of a tip's sphere that touches: directions within this angle of its axis."""
_PROBE = 1e-5
"""Radius of the spheres by which distances at points are measured [m]."""


class TipFit(NamedTuple):
    """Signed distances from points of a tip's sphere to its geometry, positive outside it [m].

    A mesh counts as its convex hull, as everywhere in Drake's distances.

    Attributes:
        least: the least; below 0 where the geometry reaches beyond the sphere.
        median: the median.
        most: the greatest; above 0 where the geometry is inside the sphere.
    """

    least: float
    median: float
    most: float


def measure_tip(
    inspector: SceneGraphInspector,
    geometries: Sequence[GeometryId],
    p_BT: Array,
    radius: float,
    axis_B: Array,
) -> TipFit:
    """Returns distances of a tip's geometry at points of its sphere within 60 degrees of its axis.

    Args:
        inspector: inspector of the SceneGraph that has the geometry.
        geometries: the tip's collision geometries, all on one body B.
        p_BT: the sphere's centre [m], shape (3,).
        radius: its radius [m].
        axis_B: the tip's axis, shape (3,).
    """
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("tip")

    def add(shape: object, X_BG: RigidTransform, name: str) -> GeometryId:
        instance = GeometryInstance(X_BG, shape, name)
        instance.set_proximity_properties(ProximityProperties())
        return scene_graph.RegisterAnchoredGeometry(source, instance)

    tips = [
        add(inspector.GetShape(g), inspector.GetPoseInFrame(g), f"tip {i}")
        for i, g in enumerate(geometries)
    ]
    points = p_BT + radius * _cap_directions(axis_B)
    probes = [
        add(Sphere(_PROBE), RigidTransform(p_BQ), f"point {i}") for i, p_BQ in enumerate(points)
    ]
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    distances = [
        [query.ComputeSignedDistancePairClosestPoints(tip, probe).distance for tip in tips]
        for probe in probes
    ]
    found = np.min(distances, axis=1) + _PROBE
    return TipFit(float(found.min()), float(np.median(found)), float(found.max()))


def _cap_directions(axis: Array) -> Array:
    """Returns unit vectors evenly spread over the cap around an axis, shape (_NUM_POINTS, 3)."""
    index = np.arange(_NUM_POINTS) + 0.5
    height = 1 - index / _NUM_POINTS * (1 - np.cos(_CAP))
    angle = np.pi * (1 + np.sqrt(5)) * index
    across = np.sqrt(1 - height**2)
    u = unit(cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    v = cross(axis, u)
    flat = across[:, None] * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
    directions: Array = flat + height[:, None] * axis
    return directions
