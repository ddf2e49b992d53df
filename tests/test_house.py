"""What every module is held to."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from rtcomp.physics import catalogue

TOP = Path(__file__).resolve().parent.parent
MODULES = sorted([*(TOP / "rtcomp").rglob("*.py"), *(TOP / "drivers" / "rtcomp_drivers").rglob("*.py")])
LONGEST = 350

Documented = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


def name_of(module: Path) -> str:
    return str(module.relative_to(TOP))


def public(body: list[ast.stmt], inside: str = "") -> Iterator[tuple[str, Documented]]:
    """Give every public class, function and method in `body`, with its dotted name."""
    for node in body:
        if isinstance(node, Documented) and not node.name.startswith("_"):
            yield f"{inside}{node.name}", node
            if isinstance(node, ast.ClassDef):
                yield from public(node.body, f"{inside}{node.name}.")


def is_override(node: Documented) -> bool:
    return any("override" in ast.unparse(decorator) for decorator in node.decorator_list)


def test_there_are_modules() -> None:
    assert len(MODULES) > 20


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_every_module_and_everything_public_in_it_has_a_docstring(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the module has none"
    without = [
        name for name, node in public(tree.body) if not ast.get_docstring(node) and not is_override(node)
    ]
    assert without == []


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_a_room_says_more_than_its_name(module: Path) -> None:
    docstring = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or ""
    assert len(docstring.split()) >= 3


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_no_module_is_long(module: Path) -> None:
    lines = len(module.read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST, f"{lines} lines; split it into concepts"


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_every_module_reads_its_annotations_late(module: Path) -> None:
    """So that what only types need is never imported."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    defines = any(isinstance(node, Documented) for node in tree.body)
    late = any(isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in tree.body)
    assert late or not defines


@pytest.mark.parametrize(
    "path", sorted((TOP / "docs" / "decisions").glob("20*.md")), ids=lambda path: str(path.stem)
)
def test_every_decision_is_indexed_and_has_its_three_parts(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert path.name in (TOP / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    headings = [line for line in text.splitlines() if line.startswith("## ")]
    assert headings == ["## Context", "## Decision", "## Consequences"]
    assert text.splitlines()[2] == path.name[:10]


def test_no_two_test_files_have_one_name() -> None:
    """The folders of tests are no packages: pytest imports every file of theirs by its bare name."""
    names = [path.name for path in (TOP / "tests").rglob("*.py") if path.name != "conftest.py"]
    assert sorted(names) == sorted(set(names))


def test_the_diagnosis_knows_no_effect_by_its_name() -> None:
    """What it looks for is the catalogue's: a name in its code would be an effect treated by itself."""
    names = {kind.name for kind in catalogue.entries()}
    written = [
        f"{name_of(module)}:{node.lineno}: {node.value}"
        for module in MODULES
        if "diagnosis" in module.parts
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in names
    ]
    assert written == []
