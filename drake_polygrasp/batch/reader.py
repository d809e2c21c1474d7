"""What the child process runs that reads models for their keys: it loads no planner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from drake_polygrasp.batch.keys import unread_digest
from drake_polygrasp.errors import PolygraspError
from drake_polygrasp.loading.model_source import model_digest


def digest_models(
    *, models: Sequence[str], package_paths: Sequence[str], packages: Mapping[str, str]
) -> list[str]:
    """Computes the digest of each model's files.

    Args:
        models: paths and URIs.
        package_paths: folders searched for packages.
        packages: folders of packages by name.

    Returns:
        Hex digests, as many as models.
    """
    return [_digest(model, package_paths, packages) for model in models]


def _digest(model: str, package_paths: Sequence[str], packages: Mapping[str, str]) -> str:
    try:
        return model_digest(model, package_paths, packages)
    except (PolygraspError, OSError, RecursionError) as error:
        return unread_digest(model, str(error))


def digest_hand(
    *, description: str, package_paths: Sequence[str], packages: Mapping[str, str]
) -> dict[str, str]:
    """Computes the digest of a hand's files.

    Args:
        description: path of the hand's description.
        package_paths: folders searched for packages.
        packages: folders of packages by name.

    Returns:
        `sha256`, or `error` with what is wrong with the hand.
    """
    from drake_polygrasp.hands.model import load_hand

    try:
        hand = load_hand(description, package_paths=package_paths, packages=packages)
    except PolygraspError as error:
        return {"error": str(error)}
    return {"sha256": hand.sha256 or ""}
