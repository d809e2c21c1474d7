"""Says in words what a placement tolerance of less than a millimetre means.

It imports nothing heavy, so that tables say the same as pages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drake_polygrasp.visualization.shown_grasp import ShownGrasp

FINE = (
    "placement under a millimetre: nothing is proved of contacts that miss by a millimetre, so "
    "fingers must be placed more precisely than that"
)
NORMALS_CHANGE = (
    "placement ends where the surface's normal changes, within a millimetre here; how far contacts "
    "may miss beyond that is what the grasp bears"
)
_MILLIMETRE = 1e-3


def placement_words(grasp: ShownGrasp) -> str:
    """Returns what a placement tolerance below a millimetre means; empty where it is not below.

    Args:
        grasp: the grasp.
    """
    tolerance, region = grasp.certificate.placement_tolerance, grasp.region
    if tolerance is None or tolerance >= _MILLIMETRE:
        return ""
    borne = 0.0 if region is None else region.least_placement_error
    return NORMALS_CHANGE if borne >= _MILLIMETRE else FINE
