"""The scale of an OBJ model, which has no place to state one, and lengths that look like no metres.

Other models state the scale of each of their meshes.
"""

from __future__ import annotations

from pathlib import Path

from drake_polygrasp.arguments import check_number
from drake_polygrasp.errors import UsageError
from drake_polygrasp.loading.model_checks import MAX_SCALE

_LEAST, _MOST = 1e-3, 5.0
"""[m], ours: what three fingertips hold is hardly smaller or larger."""
_OWN_SCALE = {
    ".urdf": "in the scale attribute of its <mesh>",
    ".sdf": "in the <scale> of its <mesh>",
    ".xml": "in the scale attribute of the <mesh> in its <asset>",
    ".yaml": "in the models that it adds",
}


def check_scale(scale: float | None, model_file: str | Path) -> float | None:
    """Returns a scale to load a model with.

    Raises:
        UsageError: when it is no scale, or the model states its own.
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


def doubts_of_units(diameter: float, where: str) -> list[str]:
    """Returns what to say of a body of that diameter [m]; nothing of one that fingers may hold."""
    if _LEAST <= diameter <= _MOST:
        return []
    where_it_is_stated = "state the scale of its meshes, or for an .obj model give --scale"
    return [
        f"{where} is {diameter:.3g} m across, for Drake reads lengths as metres; if the file means "
        + (
            f"another unit or is scaled twice, {where_it_is_stated}"
            if diameter < _LEAST
            else f"millimetres, {where_it_is_stated} 0.001"
        )
    ]
