"""The imports between packages are the ones that docs/design.md allows, and no others."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "servogen"
EVERYTHING = "everything"


def test_no_package_imports_what_the_design_does_not_allow() -> None:
    allowed = design_table()
    forbidden = [
        f"{file.relative_to(ROOT)}:{line} imports {room}"
        for file in sorted(PACKAGE.rglob("*.py"))
        for line, room in imports_of(file)
        if room != room_of(file) and not may_import(allowed, room_of(file), room)
    ]
    assert not forbidden, "\n".join(forbidden)


def test_every_package_has_a_row_in_the_design() -> None:
    rooms = {room_of(file) for file in PACKAGE.rglob("*.py")} - {""}
    assert rooms <= set(design_table()), rooms - set(design_table())


def test_the_check_is_independent_of_what_it_checks() -> None:
    allowed = design_table()
    assert "csource" not in allowed["compiler"]
    assert "compiler" not in allowed["simulator"]
    assert not allowed["verify"] - leaves(allowed)


def test_a_forbidden_import_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "wrong.py"
    file.write_text("def late() -> None:\n    from servogen.compiler import compile_sources\n")
    assert imports_of(file) == [(2, "compiler")]
    assert not may_import(design_table(), "simulator", "compiler")


def design_table() -> dict[str, set[str]]:
    """Package -> the packages that the design's table lets it import."""
    rows = {}
    for line in (ROOT / "docs" / "design.md").read_text().splitlines():
        if line.startswith("| `"):
            names, _, imports = (cell.strip() for cell in line.strip("|").split("|"))
            for name in re.findall(r"`([a-z_]+)/?`", names):
                rows[name] = set(re.findall(r"[a-z_]+", imports))
                if "leaves:" in line:
                    rows[name].add("leaf")
    return rows


def leaves(allowed: dict[str, set[str]]) -> set[str]:
    return {name for name, imports in allowed.items() if "leaf" in imports}


def may_import(allowed: dict[str, set[str]], importer: str, room: str) -> bool:
    imports = allowed.get(importer, set())
    return room in imports or room in leaves(allowed) or EVERYTHING in imports or room == "__version__"


def room_of(file: Path) -> str:
    """The package (or leaf module) of a file of servogen; "" for `servogen/__init__.py`."""
    first = file.relative_to(PACKAGE).parts[0]
    return "" if first == "__init__.py" else first.removesuffix(".py")


def imports_of(file: Path) -> list[tuple[int, str]]:
    """(line, package of servogen) of each import, wherever it stands in the file."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "servogen":
            parts = node.module.split(".")
            names = [parts[1]] if len(parts) > 1 else [alias.name for alias in node.names]
            found += [(node.lineno, name) for name in names]
        elif isinstance(node, ast.Import):
            found += [
                (node.lineno, alias.name.split(".")[1])
                for alias in node.names
                if alias.name.startswith("servogen.")
            ]
    return found
