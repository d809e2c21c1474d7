"""Reads untrusted files of plain YAML: mappings, sequences and scalars, with errors by place.

Drake's typed YAML accepts repeated keys, takes the text "0.3" for a number and does not report
missing keys. Here PyYAML, on which Drake depends, composes the nodes, and only plain data is made
of them. Tags and aliases are refused, so that no file can run code or expand when it is read.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import GraspFileError, PolygraspError
from drake_polygrasp.input_file import read_bytes

MAX_YAML_BYTES = 4_000_000
"""Greatest size of a grasp file. Our choice: some two thousand grasps."""
_PLAIN_TAGS = [f"tag:yaml.org,2002:{kind}" for kind in ("map", "seq", "str")]
_Sign = Literal["any", "positive", "zero or positive"]


def read_mapping(
    path: Path, kind: str = "grasp", error: type[PolygraspError] = GraspFileError
) -> Block:
    """Reads a file whose document is a mapping.

    Args:
        path: the file.
        kind: what messages call the file.
        error: type of the errors of this file and of the blocks in it.

    Returns:
        The mapping.

    Raises:
        PolygraspError: of type `error`, when it cannot be read, is too large, or is not a mapping
            in plain YAML.
    """
    text = _read_text(path, kind, error)
    try:
        node = _compose(text)
        value = None if node is None else _value(node, set())
    except (yaml.YAMLError, ValueError) as fault:
        raise error(f"{path}: is not plain YAML: {' '.join(str(fault).split())}") from None
    except RecursionError:
        raise error(f"{path}: is not plain YAML: nested too deeply") from None
    return Block(value, f"{path}: ", error)


def _compose(text: str) -> yaml.Node | None:
    """Returns the root node of a document, None where it is empty.

    The loaders resolve no tags, so any but `_PLAIN_TAGS` is written in the file. libyaml is ten
    times as fast; what it refuses is read again by Python, which accepts a little more and whose
    messages say more.
    """
    if yaml.__with_libyaml__:
        with suppress(yaml.YAMLError):
            return yaml.compose(text, Loader=yaml.CBaseLoader)
    return yaml.compose(text, Loader=yaml.BaseLoader)


def _read_text(path: Path, kind: str, error: type[PolygraspError]) -> str:
    try:
        return read_bytes(path, kind, MAX_YAML_BYTES, error).decode()
    except UnicodeDecodeError:
        raise error(f"{path}: is not UTF-8 text") from None


def _value(node: yaml.Node, seen: set[int]) -> Any:
    """Returns the plain value of a node, which must not be in `seen`; ValueError for other YAML."""
    line = node.start_mark.line + 1
    if id(node) in seen:
        raise ValueError(f"line {line}: an alias refers to this value; write it out")
    seen.add(id(node))
    if node.tag not in _PLAIN_TAGS:
        raise ValueError(f"line {line}: the tag {node.tag!r} is no part of the format")
    if isinstance(node, yaml.ScalarNode):
        return node.value if node.style else _scalar(node.value)
    if isinstance(node, yaml.SequenceNode):
        return [_value(item, seen) for item in node.value]
    mapping: dict[str, Any] = {}
    for key, item in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise ValueError(f"line {line}: a key must be a word")
        _value(key, seen)
        # Other readers would merge the keys of its value into this mapping.
        if key.value == "<<":
            raise ValueError(f"line {line}: the key '<<' is no part of the format")
        if key.value in mapping:
            raise ValueError(f"line {line}: the key {key.value!r} appears a second time")
        mapping[key.value] = _value(item, seen)
    return mapping


_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
# Without leading zeros, since some readers take 010 for 8.
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_NON_FINITE = re.compile(r"[-+]?\.(nan|inf)", re.IGNORECASE)


def _scalar(text: str) -> bool | int | float | str | None:
    """Returns an unquoted scalar by YAML 1.2's core schema, without octal and hexadecimal."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _NON_FINITE.fullmatch(text):
        return float(text.replace(".", ""))
    return text


class Block:
    """A mapping of a file, whose values are checked as they are read.

    Args:
        data: the mapping; an error is raised if it is anything else.
        where: where it is in the file, for messages: "box.grasp.yaml: object.".
        error: type of its errors; what methods say of GraspFileError holds for it.

    Attributes:
        data: the mapping.
        where: where it is in the file.
        error: type of its errors.
    """

    def __init__(
        self, data: object, where: str, error: type[PolygraspError] = GraspFileError
    ) -> None:
        if not isinstance(data, dict):
            raise error(f"{where.rstrip('.: ')} is {_shown(data)}, not a mapping")
        self.data: dict[str, Any] = data
        self.where = where
        self.error = error

    def get(self, key: str) -> Any:
        """Returns a value of any kind.

        Args:
            key: its key.

        Raises:
            GraspFileError: when it is missing.
        """
        if key not in self.data:
            raise self.error(f"{self.where}{key} is missing")
        return self.data[key]

    def refuse(self, key: str, demand: str) -> PolygraspError:
        """Returns the error that a value is not what it must be.

        Args:
            key: its key.
            demand: what it must be.
        """
        return self.error(f"{self.where}{key} is {_shown(self.data[key])}, not {demand}")

    def check_keys(self, known: Sequence[str]) -> None:
        """Checks that there are no keys but known ones, so that a misspelt one is not ignored.

        Args:
            known: the keys that may be there.

        Raises:
            GraspFileError: naming the first other key.
        """
        for key in self.data:
            if key not in known:
                raise self.error(
                    f"{self.where}{key} is no key of the format; leave it out, or write one of "
                    f"{', '.join(known)}"
                )

    def text(self, key: str, allowed: Sequence[str] = ()) -> Any:
        """Returns text that is not empty.

        Args:
            key: its key.
            allowed: the texts that are allowed; any where empty. GraspFileError for others.
        """
        value = self.get(key)
        if not isinstance(value, str) or not value:
            raise self.refuse(key, "text")
        if allowed and value not in allowed:
            raise self.refuse(key, f"one of {', '.join(allowed)}")
        return value

    def integer(self, key: str) -> int:
        """Returns a whole number of 0 or more; GraspFileError for anything else.

        Args:
            key: its key.
        """
        value = self.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise self.refuse(key, "a whole number")
        return value

    def number(self, key: str, sign: _Sign = "any") -> float:
        """Returns a finite number; GraspFileError for anything else.

        Args:
            key: its key.
            sign: the sign that it must have.
        """
        number = _finite(self.get(key))
        if number is None:
            raise self.refuse(key, "a finite number")
        if (sign == "positive" and number <= 0) or (sign == "zero or positive" and number < 0):
            raise self.refuse(key, sign)
        return number

    def vector(self, key: str, length: int = 3) -> Array:
        """Returns a list of finite numbers, shape (length,); GraspFileError for anything else.

        Args:
            key: its key.
            length: how many numbers it must have.
        """
        value = self.get(key)
        items = value if isinstance(value, list) else []
        numbers = [number for item in items if (number := _finite(item)) is not None]
        if len(items) != length or len(numbers) != length:
            raise self.refuse(key, f"a list of {length} finite numbers")
        return frozen(numbers)

    def items(self, key: str) -> list[Any]:
        """Returns a list of values of any kind; GraspFileError for anything else.

        Args:
            key: its key.
        """
        value = self.get(key)
        if not isinstance(value, list):
            raise self.refuse(key, "a list")
        return value

    def vectors(self, key: str) -> Array:
        """Returns a list of vectors, shape (n, 3); GraspFileError for anything else.

        Args:
            key: its key.
        """
        rows = {f"{key}[{i}]": row for i, row in enumerate(self.items(key))}
        block = Block(rows, self.where, self.error)
        return frozen(np.reshape([block.vector(name) for name in rows], (-1, 3)))

    def block(self, key: str) -> Block:
        """Returns a mapping within this one; GraspFileError for anything else.

        Args:
            key: its key.
        """
        return Block(self.get(key), f"{self.where}{key}.", self.error)

    def blocks(self, key: str) -> list[Block]:
        """Returns a list of mappings; GraspFileError for anything else.

        Args:
            key: its key.
        """
        items = enumerate(self.items(key))
        return [Block(item, f"{self.where}{key}[{i}].", self.error) for i, item in items]


def _shown(value: object) -> str:
    """Returns a value as messages quote it, shortened."""
    return "null" if value is None else reprlib.repr(value)


def _finite(value: object) -> float | None:
    """Returns a finite number as a float, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
