"""A grasp file's optional `region` block of a grasp: the errors it bears and what proves it."""

from __future__ import annotations

import math
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.geometry.surface_pieces import SurfacePiece
from drake_polygrasp.grasp import RegionCertificate

_MOST_CORNERS, _MOST_PIECES = 100, 200
"""Our choice: several times what plans state; with many more, checking would take minutes."""
_BOUNDS = ("epsilon_lower", "epsilon_upper", "squeeze_force")


def region_document(region: RegionCertificate, nhat_TB_B: Array) -> dict[str, Any]:
    """Returns a region certificate as it stands in the file: plain lists and numbers.

    Where each contact stays on one plane, `p_BV` has a polygon for each; else `pieces` has the
    pieces of the surface with their own normals.

    Args:
        region: what the grasp bears.
        nhat_TB_B: inward unit normals of the contacts, shape (3, 3).
    """
    document: dict[str, Any] = {
        "placement_error": region.placement_error.tolist(),
        "tilt_error": region.tilt_error,
        "friction_error": region.friction_error,
        "com_error": region.com_error,
        "internal_force": region.internal_force.tolist(),
    }
    if all(_is_one_plane(pieces, n) for pieces, n in zip(region.pieces, nhat_TB_B, strict=True)):
        document["p_BV"] = [pieces[0].p_BV.tolist() for pieces in region.pieces]
    else:
        document["pieces"] = [[_piece(piece) for piece in pieces] for pieces in region.pieces]
    bounds = {name: getattr(region, name) for name in _BOUNDS}
    return document | {name: value for name, value in bounds.items() if value is not None}


def _is_one_plane(pieces: tuple[SurfacePiece, ...], nhat_TB_B: Array) -> bool:
    return (
        len(pieces) == 1
        and not pieces[0].tan_spread
        and bool((pieces[0].nhat_TB_B == nhat_TB_B).all())
    )


def _piece(piece: SurfacePiece) -> dict[str, Any]:
    document = {"p_BV": piece.p_BV.tolist(), "nhat_TB_B": piece.nhat_TB_B.tolist()}
    return document | ({"tan_spread": piece.tan_spread} if piece.tan_spread else {})


def read_region(block: Block, nhat_TB_B: Array) -> RegionCertificate:
    """Reads the region certificate that a file states; nothing is proved by being read.

    Args:
        block: the `region` block of a grasp.
        nhat_TB_B: inward unit normals of the contacts, shape (3, 3).

    Returns:
        What the file states; each polygon of `p_BV` with the normal of its contact.

    Raises:
        GraspFileError: when a key is missing, or is not what it must be.
    """
    placement_error = block.vector("placement_error")
    if (placement_error < 0).any():
        raise block.refuse("placement_error", "a list of three lengths")
    tilt_error = block.number("tilt_error", "zero or positive")
    if not tilt_error < math.pi / 2:
        raise block.refuse("tilt_error", "an angle in radians below pi / 2")
    friction_error = block.number("friction_error", "zero or positive")
    if not friction_error < 1:
        raise block.refuse("friction_error", "a share of the friction, below 1")
    bounds = {
        name: block.number(name, "zero or positive") for name in _BOUNDS if name in block.data
    }
    return RegionCertificate(
        placement_error=placement_error,
        tilt_error=tilt_error,
        friction_error=friction_error,
        com_error=block.number("com_error", "zero or positive"),
        internal_force=block.vector("internal_force"),
        pieces=_read_pieces(block, nhat_TB_B),
        **bounds,
    )


def _read_pieces(block: Block, nhat_TB_B: Array) -> tuple[tuple[SurfacePiece, ...], ...]:
    """Three tuples of pieces, of which each contact's cover the surface that it may touch."""
    key = "pieces" if "pieces" in block.data else "p_BV"
    if key not in block.data:
        raise GraspFileError(f"{block.where}p_BV and pieces are missing: one of them must be there")
    contacts = block.items(key)
    if len(contacts) != 3:
        raise block.refuse(key, "a list for each of the three contacts")
    each = Block({f"{key}[{i}]": contact for i, contact in enumerate(contacts)}, block.where)
    if key == "p_BV":
        return tuple(
            (SurfacePiece(_read_corners(each, name), n),)
            for name, n in zip(each.data, nhat_TB_B, strict=True)
        )
    for name, pieces in each.data.items():
        if isinstance(pieces, list) and len(pieces) > _MOST_PIECES:
            raise each.refuse(name, f"a list of at most {_MOST_PIECES} pieces")
    return tuple(tuple(_read_piece(piece) for piece in each.blocks(name)) for name in each.data)


def _read_piece(block: Block) -> SurfacePiece:
    spread = block.number("tan_spread", "zero or positive") if "tan_spread" in block.data else 0.0
    return SurfacePiece(_read_corners(block, "p_BV"), block.vector("nhat_TB_B"), spread)


def _read_corners(block: Block, key: str) -> Array:
    """Reads the corners of a piece, shape (n, 3)."""
    if not 1 <= len(block.items(key)) <= _MOST_CORNERS:
        raise block.refuse(key, f"a list of 1 to {_MOST_CORNERS} corners")
    return block.vectors(key)
