"""What `help()` says of each public name: its arguments, what it returns and what it raises."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import drake_polygrasp

PACKAGE = Path(drake_polygrasp.__file__).parent
ROOMS = {
    path.stem
    for path in PACKAGE.iterdir()
    if path.suffix == ".py" or (path / "__init__.py").exists()
}
"""Rooms, and files at the top."""
SECTIONS = ("Args", "Attributes", "Returns", "Yields", "Raises", "Example")
PRIVATE_IDIOM = re.compile(r"(?i:\bours\b|\bas of\b|see there)|^Of ", re.MULTILINE)
"""What the prose of the project does without."""


class Named(NamedTuple):
    """A public function, method or class."""

    place: str
    node: ast.FunctionDef | ast.ClassDef

    @property
    def doc(self) -> str:
        return ast.get_docstring(self.node) or ""

    def section(self, title: str) -> str | None:
        """The text of a section, None where there is none."""
        titles = "|".join(SECTIONS)
        pattern = rf"^{title}:\n(.*?)(?=^(?:{titles}):\n|\Z)"
        found = re.search(pattern, self.doc + "\n", re.MULTILINE | re.DOTALL)
        return found and found[1]

    def entries(self, title: str) -> list[str]:
        """Names that a section explains, in its order."""
        heads = re.findall(r"^    (\*{0,2}\w[\w, *]*):", self.section(title) or "", re.MULTILINE)
        return [name.strip("* ") for head in heads for name in head.split(",")]


def public_names(room: str) -> Iterator[Named]:
    """Yields the public functions, methods and classes of a room or a file at the top."""
    files = sorted((PACKAGE / room).glob("*.py")) or [PACKAGE / f"{room}.py"]
    for file in files:
        place = str(file.relative_to(PACKAGE))
        yield from _public_in(ast.parse(file.read_text()), place)


def _public_in(node: ast.Module | ast.ClassDef, place: str) -> Iterator[Named]:
    for child in node.body:
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and child.name[0] != "_":
            yield Named(f"{place}: {child.name}", child)
            if isinstance(child, ast.ClassDef):
                yield from _public_in(child, f"{place}: {child.name}")


def functions(room: str) -> Iterator[tuple[Named, ast.FunctionDef]]:
    for named in public_names(room):
        if isinstance(named.node, ast.FunctionDef):
            yield named, named.node


def is_property(function: ast.FunctionDef) -> bool:
    names = {getattr(d, "id", getattr(d, "attr", "")) for d in function.decorator_list}
    return bool(names & {"property", "cached_property"})


def parameters(function: ast.FunctionDef) -> list[str]:
    args = function.args
    every = [*args.posonlyargs, *args.args]
    every += [args.vararg] if args.vararg else []
    every += args.kwonlyargs
    every += [args.kwarg] if args.kwarg else []
    return [arg.arg for arg in every if arg.arg not in ("self", "cls")]


def own_raises(function: ast.FunctionDef) -> Iterator[ast.Raise]:
    """Yields the exceptions that a function raises anew, not those of functions within it."""
    waiting: list[ast.AST] = [*function.body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Raise) and node.exc is not None:
            yield node
        elif not isinstance(node, ast.FunctionDef | ast.ClassDef):
            waiting += ast.iter_child_nodes(node)


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_a_docstring_opens_with_a_sentence(room: str) -> None:
    for named in public_names(room):
        first = named.doc.split("\n\n")[0]
        assert first, f"{named.place} says nothing"
        assert first[0].isupper() or first[0] == "`", named.place
        assert first.rstrip()[-1] in ".:", named.place
        assert not (found := PRIVATE_IDIOM.search(named.doc)), f"{named.place}: {found}"


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_every_argument_is_explained(room: str) -> None:
    for named, function in functions(room):
        assert named.entries("Args") == parameters(function), named.place


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_what_is_returned_and_raised_is_said(room: str) -> None:
    for named, function in functions(room):
        returns = ast.unparse(function.returns) if function.returns else "None"
        if returns != "None" and not is_property(function):
            opens = named.doc.startswith(("Returns ", "Yields "))
            assert opens or named.section("Returns") or named.section("Yields"), named.place
        for error in own_raises(function):
            assert error.exc is not None
            raised = error.exc.func if isinstance(error.exc, ast.Call) else error.exc
            if isinstance(raised, ast.Name) and raised.id[0].isupper():
                assert raised.id in (named.section("Raises") or ""), f"{named.place}: {raised.id}"


@pytest.mark.parametrize("room", sorted(ROOMS))
def test_every_attribute_is_explained_where_help_shows_it(room: str) -> None:
    for named in public_names(room):
        if isinstance(named.node, ast.ClassDef):
            fields = [
                field.target.id
                for field in named.node.body
                if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
                if field.target.id[0] != "_" and "ClassVar" not in ast.unparse(field.annotation)
            ]
            told = named.entries("Attributes")
            assert [name for name in told if name in fields] == fields, named.place
