"""Objects of a hand's size: models and folders scaled into its range, and generated ones."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from pydrake.geometry import HalfSpace
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial import ConvexHull

from benchmarks.objects import in_folder, models
from drake_polygrasp import GraspObject, PolygraspError, Surroundings, load_object
from drake_polygrasp.arrays import Array

LEAST, MOST = 0.025, 0.13
"""Sides of an object of hand scale [m]: on a table, tips of 10 mm need 12 mm above it."""
MU = 0.5
_CANS = ((15, 90), (25, 60), (33, 115), (40, 30), (20, 40))
_CAPSULES = ((14, 60), (20, 40), (30, 50))
"""Radius and length [mm]."""
_LENGTHS = {"size", "radius", "length", "radii"}
_NO_SCALE = "1 1 1"
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


class HandObject(NamedTuple):
    """An object to grasp."""

    name: str
    file: Path


class _Body(NamedTuple):
    name: str
    parts: tuple[tuple[str, str], ...]
    """Pose and geometry of each part, as SDF writes them."""


def subjects(out: Path, folders: list[Path], factor: float = 1.0) -> Iterator[HandObject]:
    """Writes all objects, scaled, to a folder; those that no scale fits into range are left out."""
    for body in _generated():
        yield from _scaled(_written(out, body), body.name, out, factor, as_is=True)
    for subject in models():
        yield from _scaled(subject.file, subject.name, out, factor)
    for folder in folders:
        for subject in in_folder(folder):
            if subject.file.suffix != ".obj":
                yield from _scaled(subject.file, Path(subject.name).stem, out, factor)


def _generated() -> list[_Body]:
    """Boxes, cans, balls, capsules, mugs and a hammer of 2.5 to 13 cm."""
    sizes = [(3, 3, 3), (5, 5, 5), (8, 8, 8), (3, 5, 9), (4, 8, 12), (6, 6, 3), (10, 4, 4)]
    bodies = [
        _Body(f"box_{a}_{b}_{c}", (("0 0 0 0 0 0", _box(a / 100, b / 100, c / 100)),))
        for a, b, c in sizes
    ]
    rounds = [("can", "cylinder", *size) for size in _CANS]
    rounds += [("capsule", "capsule", *size) for size in _CAPSULES]
    for name, kind, radius, length in rounds:
        shape = _round(kind, radius / 1000, length / 1000)
        bodies.append(_Body(f"{name}_{radius}_{length}", (("0 0 0 0 0 0", shape),)))
    for radius in (15, 25, 40):
        shape = f"<sphere><radius>{radius / 1000}</radius></sphere>"
        bodies.append(_Body(f"ball_{radius}", (("0 0 0 0 0 0", shape),)))
    for inner, height in ((0.032, 0.08), (0.04, 0.1)):
        far, rise = inner + 0.025, 0.6 * height
        handle = (
            (f"{far} 0 0 0 0 0", _box(0.01, 0.012, rise)),
            (f"{inner + 0.01} 0 {rise / 2 - 0.005} 0 0 0", _box(0.04, 0.012, 0.01)),
            (f"{inner + 0.01} 0 {0.005 - rise / 2} 0 0 0", _box(0.04, 0.012, 0.01)),
        )
        cup = ("0 0 0 0 0 0", _round("cylinder", inner, height))
        bodies.append(_Body(f"mug_{1000 * inner:.0f}", (cup, *handle)))
    head = ("0.055 0 0 0 0 0", _box(0.03, 0.08, 0.03))
    bodies.append(_Body("hammer", (("0 0 0 0 1.5708 0", _round("cylinder", 0.0135, 0.1)), head)))
    return bodies


def _box(x: float, y: float, z: float) -> str:
    return f"<box><size>{x} {y} {z}</size></box>"


def _round(kind: str, radius: float, length: float) -> str:
    return f"<{kind}><radius>{radius}</radius><length>{length}</length></{kind}>"


def _written(out: Path, body: _Body) -> Path:
    """A model of SDF with these parts."""
    parts = "".join(
        f'<collision name="part_{k}"><pose>{pose}</pose><geometry>{shape}</geometry></collision>'
        for k, (pose, shape) in enumerate(body.parts)
    )
    inertia = "<ixx>1e-4</ixx><iyy>1e-4</iyy><izz>1e-4</izz><ixy>0</ixy><ixz>0</ixz><iyz>0</iyz>"
    file = out / f"{body.name}_own.sdf"
    file.write_text(
        f'<sdf version="1.9"><model name="{body.name}"><link name="{body.name}"><inertial>'
        f"<mass>0.15</mass><inertia>{inertia}</inertia></inertial>{parts}</link></model></sdf>"
    )
    return file


def _scaled(
    file: Path, name: str, out: Path, factor: float, *, as_is: bool = False
) -> Iterator[HandObject]:
    try:
        sides = np.ptp(load_object(file).polyhedron.triangles_B.reshape(-1, 3), axis=0)
    except PolygraspError as error:
        print(f"{name}: left out: {error}")
        return
    scale = 1.0 if as_is else min(1.0, MOST / sides.max())
    if not as_is and scale * sides.min() < LEAST:
        scale = LEAST / sides.min()
        if scale * sides.max() > 1.2 * MOST:
            print(f"{name}: left out: its sides, 1 : {sides.max() / sides.min():.0f}, fit no hand")
            return
    text = file.read_text()
    # Prefixes are lost but for those that are registered.
    for namespace in re.findall(r'xmlns:drake="([^"]*)"', text):
        ElementTree.register_namespace("drake", namespace)
    root = ElementTree.fromstring(text)
    _scale(root, float(factor * scale), file.parent)
    _mend_inertia(root, factor * scale, factor * scale * sides)
    scaled = out / f"{name}_{factor:g}{file.suffix}"
    scaled.write_text(ElementTree.tostring(root, encoding="unicode"))
    yield HandObject(name, scaled)


def _scale(root: ElementTree.Element, scale: float, folder: Path) -> None:
    """Scales all lengths of a model of SDF or URDF, and names meshes by their whole paths."""
    for element in root.iter():
        if root.tag == "sdf":
            _scale_sdf(element, scale, folder)
        else:
            for key in _LENGTHS & {*element.attrib}:
                element.set(key, _times(element.attrib[key], scale))
            if element.tag == "origin" and "xyz" in element.attrib:
                element.set("xyz", _times(element.attrib["xyz"], scale))
            if element.tag == "mesh":
                element.set("scale", _times(element.get("scale", _NO_SCALE), scale))
                element.set("filename", _whole(element.get("filename", ""), folder))


def _mend_inertia(root: ElementTree.Element, scale: float, sides: Array) -> None:
    """Scales the inertia of a model at the same mass; one that no body has becomes a box's."""
    for inertial in root.iter("inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        if mass is None or inertia is None:
            continue
        values = mass.get("value") or mass.text or "0"
        of_box = float(values) / 12 * (sides @ sides - sides**2)
        moments = {}
        for key in _MOMENTS:
            child = inertia.find(key)
            text = inertia.get(key) if child is None else child.text
            moments[key] = scale**2 * float(text or 0.0)
        xx, yy, zz, xy, xz, yz = moments.values()
        full = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if not np.linalg.eigvalsh(full).min() > 0:
            moments = dict(zip(_MOMENTS, [*of_box.tolist(), 0.0, 0.0, 0.0], strict=True))
        for key, value in moments.items():
            child = inertia.find(key)
            if child is None:
                inertia.set(key, repr(float(value)))
            else:
                child.text = repr(float(value))


def _scale_sdf(element: ElementTree.Element, scale: float, folder: Path) -> None:
    if element.tag in _LENGTHS:
        element.text = _times(element.text or "", scale)
    elif element.tag == "pose":
        words = (element.text or "0 0 0 0 0 0").split()
        element.text = " ".join([_times(" ".join(words[:3]), scale), *words[3:]])
    elif element.tag == "mesh":
        found = element.find("scale")
        if found is None:
            found = ElementTree.SubElement(element, "scale")
            found.text = _NO_SCALE
        found.text = _times(found.text or _NO_SCALE, scale)
        uri = element.find("uri")
        if uri is not None:
            uri.text = _whole(uri.text or "", folder)


def _times(text: str, scale: float) -> str:
    return " ".join(repr(float(word) * scale) for word in text.split())


def _whole(uri: str, folder: Path) -> str:
    """A mesh's whole path; of a package, the file of that name in the folder."""
    return str((folder / uri.strip().rpartition("/")[2]).resolve())


def resting(object_: GraspObject) -> tuple[Array, Surroundings]:
    """Direction against gravity as the object stands most stably, and the table under it."""
    points = object_.polyhedron.triangles_B.reshape(-1, 3)
    hull = ConvexHull(points)
    planes = np.unique(np.round(hull.equations, 6), axis=0)
    stable = []
    for *normal, offset in planes.tolist():
        down = np.array(normal) / np.linalg.norm(normal)
        on = points[np.abs(points @ down + offset) < 1e-4 * object_.polyhedron.diameter]
        height = float(-offset - object_.p_BBcm @ down)
        stable.append((height / _support(on, object_.p_BBcm, down), down.tolist(), offset))
    _, down, offset = min(stable)
    up_B = -np.array(down)
    R_BG = RotationMatrix.MakeFromOneVector(up_B, 2)
    table = ("table", HalfSpace(), RigidTransform(R_BG, offset * up_B))
    return up_B, Surroundings((table,))


def _support(points: Array, p_BBcm: Array, down: Array) -> float:
    """How far inside a support polygon the centre of mass is [m], a little if it is not."""
    axes = RotationMatrix.MakeFromOneVector(down, 2).matrix()[:, :2]
    flat, centre = points @ axes, p_BBcm @ axes
    if len(flat) < 3 or np.linalg.matrix_rank(flat - flat[0], tol=1e-9) < 2:
        return 1e-6
    hull = ConvexHull(flat)
    inside = -(hull.equations[:, :2] @ centre + hull.equations[:, 2]).max()
    return max(float(inside), 1e-6)
