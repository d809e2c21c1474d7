"""From a model file to the object to grasp.

Drake reads the files; what it assumes silently where they say nothing is looked up in them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from drake_polygrasp.loading.shapes import is_hull, mended


@dataclass(frozen=True)
class Solid:
    """A rigid body as its model has it, all its links together.

    Attributes:
        M_BBo_B: about Bo, expressed in B.
        parts: each collision geometry G's shape and pose X_BG.
        covers: likewise, of links on joints in the model's default posture, with their names.
        is_hulls: whether each of both is its own convex hull, which is what point contact makes of
            a Mesh.
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
    """Load the rigid body to grasp from a file that Drake's Parser reads.

    Links that the model fixes to one another are one rigid body: surface, friction, mass and centre
    of mass are those of all of them, in the frame of the link that `body_name` names.
    Links on joints, in the model's default posture, cover its faces and leave fingertips no room;
    their mass is not counted. With `joints_free` they are ignored.

    `model_file` is a path or a package:// URI. Packages are searched below `package_paths` and in
    the folders above the model file, and `packages` gives folders of packages by name. `body_name`
    may be left out when just one rigid body has collision geometry, and B is then the frame of its
    base link; `model::body` tells bodies of one name apart. `mu` replaces the friction of the
    model, which is else the lesser of each geometry's static and dynamic coefficients: in discrete
    time Drake's bodies slide at the dynamic one. Surfaces of very many facets become patches whose
    normals lean by at most `patch_angle` [rad] (default: 12 degrees) and whose facets lie about
    `patch_depth` [m] (default: 0.005 of the diameter) off a plane. `scale` multiplies the lengths
    of an .obj model, 0.001 for millimetres (default: 1); other models state their own.

    Raises ModelError when a file is missing or malformed, the body cannot be told, or its
    collision geometry is nothing to hold; UsageError when `mu` is not above 0, a patch cannot be
    as asked for, or `scale` is none or for a model that states its own.
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
        warnings.append(f"{where}: what constraints of the model tie to it is left out")
    inspector = parsed.scene_graph.model_inspector()
    colliders = group.colliders(parsed.plant, inspector)
    links = _statements(parsed, colliders)
    if mu is None:
        friction, assumed = _friction(inspector, links, where)
        warnings += assumed
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
        warnings.append(f"{where}: its mass is unknown, for the model states none of {names}")
    stated = None if unstated else mass_properties(group, parsed.context)
    return object_of(
        parts,
        covering_parts(inspector, covers, where),
        stated,
        where,
        warnings,
        source,
        patch_angle,
        patch_depth,
    )


def reload_object(
    source: ModelSource,
    *,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> GraspObject:
    """Loads an object again from its source, with the options that it was loaded with.

    Args:
        source: where the object came from. Its digest and links are not compared.
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
    """The rigid body that an object came from, read again, for plants of our own.

    Raises ModelError as `load_object` does.
    """
    files = parse_files(source.model_file, package_paths, packages, source.scale)
    parsed = choose_body(files, scoped_name(source))
    inspector = parsed.scene_graph.model_inspector()
    group = parsed.group
    covering = () if source.joints_free else group.covers(parsed.plant, inspector)
    parts = [
        (mended(inspector.GetShape(geometry)), X_BG)
        for geometry, X_BG, _ in group.colliders(parsed.plant, inspector)
    ]
    covers = [
        (group.name_of(link), mended(inspector.GetShape(geometry)), X_BG)
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
    """Returns the names of an object's model and body, which tell bodies of one name apart.

    Args:
        source: where the object came from.

    Returns:
        "model::body", as Drake scopes names.
    """
    return f"{source.model_name}::{source.body_name}"


class _StatedLink(NamedTuple):
    """A link of a rigid body and what its files state of it."""

    name: str
    mass: float
    """Drake's [kg]."""
    colliders: tuple[Collider, ...]
    statements: Statements

    @property
    def has_mass(self) -> bool:
        """Whether its mass is stated; a link that is but a frame, without mass, needs none."""
        if self.mass == 0:
            return not self.colliders
        return self.statements.mass and self.mass > 0


def _statements(parsed: ParsedModel, colliders: Sequence[Collider]) -> list[_StatedLink]:
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
    """The coefficient of each collider, and what was assumed of it."""
    friction: list[float] = []
    warnings: list[str] = []
    assumed: dict[str, dict[str, None]] = {}
    for link, _, colliders, statements in links:
        places = " or ".join(statements.unread)
        reason = f", for Drake reads no friction from {places}" if places else ""
        for geometry, _, _ in colliders:
            pair = stated_friction(inspector, geometry)
            # Drake's default; only the file can tell whether it was meant.
            if pair is None or (pair == (1, 1) and not statements.friction[geometry]):
                friction.append(DEFAULT_MU)
                assumed.setdefault(reason, {})[link] = None
            else:
                mu, said = lesser_friction(*pair, inspector.GetName(geometry), where)
                friction.append(mu)
                warnings += said
    for reason, names in assumed.items():
        it = ": link" if len(names) == 1 else ": each of the links"
        it = "" if len(links) == 1 else f"{it} {quote_names(list(names))}"
        warnings.append(f"{where}{it} states no friction; {DEFAULT_MU} is assumed{reason}")
    return friction, warnings
