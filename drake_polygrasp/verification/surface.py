"""Compares the contacts that a grasp file states with the surface of its model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from drake_polygrasp.files.stated_grasp import StatedGrasp
from drake_polygrasp.geometry.exclusion import Exclusion
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_contact import LocatedContacts
from drake_polygrasp.verification.numbers import ROUNDING, check_proof


def surface_violations(
    stated: StatedGrasp, polyhedron: Polyhedron, touched: LocatedContacts, avoided: Exclusion
) -> Iterator[str]:
    """Yields the contacts that the surface does not have, or that the plan avoids.

    Args:
        stated: a grasp of a file.
        polyhedron: the model's surface.
        touched: its contacts, as they are found there.
        avoided: where the plan says that no finger may be.

    Yields:
        One message for each violated claim.
    """
    grasp, x = stated.grasp, stated.certificate.internal_force
    mu = grasp.mu.copy()
    for i, k in enumerate(touched.face):
        if k < 0:
            yield f"contact {i + 1} is not on the exposed surface, or not along its normal"
        mu[i] = min(mu[i], polyhedron.faces[k].mu)
        if not grasp.mu[i] <= mu[i] * (1 + ROUNDING):
            yield f"contact {i + 1} claims friction {grasp.mu[i]:.6g}, its face has {mu[i]:.6g}"
    for i, is_avoided in enumerate(avoided.avoids(grasp.nhat_TB_B, touched.face)):
        if is_avoided:
            yield f"contact {i + 1} is where the plan says that no finger may be"
    # Near the boundary of force closure, errors within the tolerances above could matter.
    true = replace(grasp, p_BC=touched.p_BC, nhat_TB_B=touched.nhat_TB_B, mu=mu)
    if check_proof(grasp, x).ok and not (check := check_proof(true, x)).ok:
        yield f"with the surface's own points and normals, {check.reason}"
