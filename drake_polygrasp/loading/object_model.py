"""Loads the object to grasp from a model file: `load_object`.

Drake parses the files; which values are stated, and which are Drake's defaults, is looked up in
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from pydrake.geometry import SceneGraphInspector, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.tree import SpatialInertia

from drake_polygrasp.arguments import check_flag, check_path, check_paths, check_text
from drake_polygrasp.geometry.patches import check_tolerances
from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.loading.body_object import (
    DEFAULT_MU,
    check_friction,
    collision_parts,
    covering_parts,
    describe_group,
    friction_warnings,
    lesser_friction,
    mass_properties,
    object_of,
    quote_names,
    stated_friction,
)
from drake_polygrasp.loading.model_statements import Statements, read_statements
from drake_polygrasp.loading.packages import is_uri
from drake_polygrasp.loading.parsed_model import ParsedModel, choose_body, parse_files
from drake_polygrasp.loading.rigid_group import Collider, bodies_beside, rigid_bodies
from drake_polygrasp.loading.scale import check_scale
from drake_polygrasp.loading.shapes import is_hull, repaired


@dataclass(frozen=True)
class Solid:
    """A rigid body as Drake's shapes and inertia, all its links together.

    Attributes:
        M_BBo_B: spatial inertia about Bo, expressed in B.
        parts: shape and pose X_BG of each collision geometry.
        covers: name of the link, shape and pose X_BG of each collision geometry of links on joints,
            in the model's default posture.
        is_hulls: whether each shape is its own convex hull, which is what Drake's point contact
            makes of a Mesh.
    """

    M_BBo_B: SpatialInertia
    parts: tuple[tuple[Shape, RigidTransform], ...]
    covers: tuple[tuple[str, Shape, RigidTransform], ...]
    is_hulls: bool


def load_object(
    model_file: str | Path,
    *,
    body_name: str | None = None,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    patch_angle: float | None = None,
    patch_depth: float | None = None,
    joints_free: bool = False,
    scale: float | None = None,
) -> GraspObject:
    """Loads the rigid body to grasp from a file that Drake's Parser reads.

        bracket = load_object("models/l_bracket/l_bracket.sdf")

    Links that the model fixes to one another are one rigid body, with the surface, friction, mass
    and centre of mass of all of them. Links on its joints, in the model's default posture, cover
    its faces and block fingertips; their mass is not counted.

    Args:
        model_file: a path, or a package://, model:// or file:// URI.
        body_name: name of one of the body's links, alone or as "model::link"; its frame is B. By
            default, the base link of the only rigid body that has collision geometry.
        mu: friction coefficient of all faces, above 0. By default each geometry's, the lesser of
            static and dynamic, since bodies slide at the dynamic one in Drake's discrete time; 0.3
            where the model states none.
        package_paths: folders searched for the packages of URIs, beside those above the model file.
        packages: folders of packages by name, which take precedence.
        patch_angle: greatest angle between the normal of a patch and those of its facets [rad],
            below pi/2 (default: 12 degrees). Curved surfaces and surfaces of very many facets are
            divided into patches.
        patch_depth: greatest distance of facets from the plane of their patch [m], about (default:
            0.005 of the object's diameter).
        joints_free: whether links on joints are ignored.
        scale: factor for the lengths of an .obj model, 0.001 for millimetres (default: 1); other
            models state their own.

    Returns:
        The object: its exposed surface, mass, centre of mass and friction, with warnings on how the
        model was read.

    Raises:
        ModelError: when a file is missing or malformed, the body is not there or not unique, or its
            collision geometry cannot be grasped.
        UsageError: when an argument has the wrong type or value, or `scale` is given for a model
            that states its own.
    """
    check_path("model_file", model_file)
    if body_name is not None:
        check_text("body_name", body_name)
    package_paths = check_paths("package_paths", package_paths)
    check_tolerances(patch_angle, patch_depth)
    joints_free = check_flag("joints_free", joints_free)
    check_friction(mu, str(model_file))
    scale = check_scale(scale, model_file)
    parsed = choose_body(parse_files(model_file, package_paths, packages, scale), body_name)
    files, group, warnings = parsed.files, parsed.group, parsed.warnings
    where = f"{files.model_file}: body '{group.body.name()}'"
    warnings += describe_group(group, where, joints_free, bodies_beside(parsed.plant, group))
    if parsed.plant.num_constraints() and len(rigid_bodies(parsed.plant)) > 1:
        warnings.append(f"{where}: bodies that constraints of the model tie to it are left out")
    inspector = parsed.scene_graph.model_inspector()
    colliders = group.colliders(parsed.plant, inspector)
    links = _statements(parsed, colliders)
    if mu is None:
        friction, messages = _friction(inspector, links, where)
        warnings += messages
    else:
        friction = [mu] * len(colliders)
    parts = collision_parts(inspector, colliders, friction, where)
    covers = () if joints_free else group.covers(parsed.plant, inspector)
    source = ModelSource(
        model_file=model_file if is_uri(model_file) else files.model_file.absolute(),
        sha256=files.sha256,
        model_name=parsed.plant.GetModelInstanceName(group.body.model_instance()),
        body_name=group.body.name(),
        patch_angle=patch_angle,
        patch_depth=patch_depth,
        links=group.names if len(group.links) > 1 else (),
        joints_free=joints_free,
        scale=scale,
    )
    unstated = [link.name for link in links if not link.has_mass]
    if unstated and len(unstated) < len(links):
        names = quote_names(unstated)
        warnings.append(f"{where}: its mass is unknown, as the model states none of {names}")
    stated = None if unstated else mass_properties(group, parsed.context)
    object_ = object_of(
        parts,
        covering_parts(inspector, covers, where),
        stated,
        where,
        warnings,
        source,
        patch_angle,
        patch_depth,
    )
    return replace(object_, mu=mu)


def reload_object(
    source: ModelSource,
    *,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> GraspObject:
    """Loads an object again from its source, with the options that it was loaded with.

    Args:
        source: the model and how it was loaded; its digest and links are not compared.
        mu: friction coefficient of all faces; None for the model's.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.

    Returns:
        The object as the model has it now.

    Raises:
        ModelError: when `load_object` raises it.
    """
    return load_object(
        source.model_file,
        body_name=scoped_name(source),
        mu=mu,
        package_paths=package_paths,
        packages=packages,
        patch_angle=source.patch_angle,
        patch_depth=source.patch_depth,
        joints_free=source.joints_free,
        scale=source.scale,
    )


def load_solid(
    source: ModelSource,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> Solid:
    """Loads the rigid body that an object came from as Drake's shapes, for our own plants.

    Args:
        source: the model and how it was loaded.
        package_paths: folders searched for the packages of URIs.
        packages: folders of packages by name.

    Returns:
        The rigid body in its frame B.

    Raises:
        ModelError: when a file is missing or malformed, or the body is no longer in it.
    """
    files = parse_files(source.model_file, package_paths, packages, source.scale)
    parsed = choose_body(files, scoped_name(source))
    inspector = parsed.scene_graph.model_inspector()
    group = parsed.group
    covering = () if source.joints_free else group.covers(parsed.plant, inspector)
    parts = [
        (repaired(inspector.GetShape(geometry)), X_BG)
        for geometry, X_BG, _ in group.colliders(parsed.plant, inspector)
    ]
    covers = [
        (group.name_of(link), repaired(inspector.GetShape(geometry)), X_BG)
        for geometry, X_BG, link in covering
    ]
    shapes = [shape for shape, _ in parts] + [shape for _, shape, _ in covers]
    return Solid(
        group.spatial_inertia(parsed.context),
        tuple(parts),
        tuple(covers),
        all(map(is_hull, shapes)),
    )


def scoped_name(source: ModelSource) -> str:
    """Returns the scoped name of an object's body, "model::body".

    Args:
        source: the model and how it was loaded.
    """
    return f"{source.model_name}::{source.body_name}"


class _StatedLink(NamedTuple):
    """A link of a rigid body and what its files state of it."""

    name: str
    mass: float
    """Mass in Drake's plant [kg]."""
    colliders: tuple[Collider, ...]
    statements: Statements

    @property
    def has_mass(self) -> bool:
        """Whether its mass is stated or it needs none, being only a frame without geometry."""
        if self.mass == 0:
            return not self.colliders
        return self.statements.mass and self.mass > 0


def _statements(parsed: ParsedModel, colliders: Sequence[Collider]) -> list[_StatedLink]:
    """Returns what the files state of each link of the rigid body."""
    inspector = parsed.scene_graph.model_inspector()
    return [
        _StatedLink(
            parsed.group.name_of(link.body),
            link.body.default_mass(),
            tuple(c for c in colliders if c.link.index() == link.body.index()),
            read_statements(parsed.files, parsed.plant, inspector, link.body),
        )
        for link in parsed.group.links
    ]


def _friction(
    inspector: SceneGraphInspector, links: Sequence[_StatedLink], where: str
) -> tuple[list[float], list[str]]:
    """Returns the coefficient of each collider, and warnings, among them of assumed ones."""
    friction: list[float] = []
    stated: list[tuple[str, tuple[float, float]]] = []
    assumed: list[tuple[str, str, Sequence[str]]] = []
    for link, _, colliders, statements in links:
        places = " or ".join(statements.unread)
        reason = f", because Drake reads no friction from {places}" if places else ""
        silent = []
        for geometry, _, _ in colliders:
            name, pair = inspector.GetName(geometry), stated_friction(inspector, geometry)
            # (1, 1) is Drake's default; only the file can tell whether it is stated.
            if pair is None or (pair == (1, 1) and not statements.friction[geometry]):
                friction.append(DEFAULT_MU)
                silent.append(name)
            else:
                stated.append((name, pair))
                friction.append(lesser_friction(*pair, name, where))
        if silent:
            assumed.append((link, reason, silent if len(silent) < len(colliders) else ()))
    warnings = [*friction_warnings(stated, where), *_assumed_friction(assumed, len(links), where)]
    return friction, warnings


def _assumed_friction(
    silent: Sequence[tuple[str, str, Sequence[str]]], num_links: int, where: str
) -> Iterator[str]:
    """Yields warnings of friction that is assumed.

    Args:
        silent: links that state none, the reason, and their shapes that state none, if others do.
        num_links: number of the body's links.
        where: what messages call the body.
    """
    for reason in dict.fromkeys(reason for _, reason, _ in silent):
        end = f" states no friction; {DEFAULT_MU} is assumed{reason}"
        names = [link for link, why, shapes in silent if why == reason and not shapes]
        if names:
            who = ": link" if len(names) == 1 else ": each of the links"
            yield where + ("" if num_links == 1 else f"{who} {quote_names(names)}") + end
        shapes = [name for _, why, some in silent if why == reason for name in some]
        if shapes:
            who = "collision geometry" if len(shapes) == 1 else "each of the collision geometries"
            yield f"{where}: {who} {quote_names(shapes)}{end}"
