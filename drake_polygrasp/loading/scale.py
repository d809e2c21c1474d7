"""Checks the scale given for an OBJ model, and warns of lengths that are unlikely in metres.

An OBJ file cannot state its unit; models of other formats state the scale of each mesh.
"""

from __future__ import annotations

from pathlib import Path

from drake_polygrasp.arguments import check_number
from drake_polygrasp.errors import UsageError
from drake_polygrasp.loading.model_checks import MAX_SCALE

_MIN_DIAMETER, _MAX_DIAMETER = 1e-3, 5.0
"""Diameters of objects that three fingertips may hold [m]. Our choice."""
_OWN_SCALE = {
    ".urdf": "in the scale attribute of its <mesh>",
    ".sdf": "in the <scale> of its <mesh>",
    ".xml": "in the scale attribute of the <mesh> in its <asset>",
    ".yaml": "in the models that it adds",
}


def check_scale(scale: float | None, model_file: str | Path) -> float | None:
    """Returns the scale to load a model with.

    Args:
        scale: the factor given by the user; None if none is given.
        model_file: the model, for which it is given.

    Raises:
        UsageError: when it is no number from 1 / MAX_SCALE to MAX_SCALE, or the model is not .obj.
    """
    if scale is None:
        return None
    suffix = Path(str(model_file)).suffix.lower()
    if suffix != ".obj":
        raise UsageError(
            f"scale is for .obj models; {model_file} states its own "
            f"{_OWN_SCALE.get(suffix, 'for each mesh')}"
        )
    demand = f"a factor from {1 / MAX_SCALE:g} to {MAX_SCALE:g}"
    return check_number("scale", scale, demand, least=1 / MAX_SCALE, most=MAX_SCALE)


def unit_warnings(diameter: float, where: str) -> list[str]:
    """Returns a warning if a body's size suggests that its lengths are not in metres.

    Args:
        diameter: the body's diameter as Drake reads it [m].
        where: what messages call the body.
    """
    if _MIN_DIAMETER <= diameter <= _MAX_DIAMETER:
        return []
    where_it_is_stated = "state the scale of its meshes, or for an .obj model give --scale"
    return [
        f"{where} is {diameter:.3g} m across, as Drake reads lengths in metres; if the file means "
        + (
            f"another unit or is scaled twice, {where_it_is_stated}"
            if diameter < _MIN_DIAMETER
            else f"millimetres, {where_it_is_stated} 0.001"
        )
    ]
