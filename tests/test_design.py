"""The imports between packages are the ones that docs/design.md allows, and no others."""

import ast
import re
from pathlib import Path

from servogen.graph import components
from servogen.pic.isa import by_mnemonic

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


def test_the_library_is_under_the_command_line() -> None:
    """Only `python -m servogen` calls a command; the pytest plugin and the build stand on the library."""
    importers = {
        room_of(file) for file in PACKAGE.rglob("*.py") for _, room in imports_of(file) if room == "cli"
    }
    assert importers == {"cli", "__main__"}


def test_the_check_is_independent_of_what_it_checks() -> None:
    allowed = design_table()
    assert "engines" not in allowed["compiler"]
    assert "compiler" not in allowed["simulator"]
    assert not allowed["verify"] - leaves(allowed)


def test_no_stage_of_the_compiler_imports_what_the_design_does_not_allow() -> None:
    allowed = design_table("stage")
    compiler = PACKAGE / "compiler"
    forbidden = []
    for file in sorted(compiler.rglob("*.py")):
        stage = file.relative_to(compiler).parts[0].removesuffix(".py")
        for line, module in modules_of(file):
            other = [*module.removeprefix("servogen.compiler").split("."), ""][1]
            inside = module.startswith("servogen.compiler.") and stage not in ("__init__", other)
            if inside and other not in allowed[stage] and EVERYTHING not in allowed[stage]:
                forbidden.append(f"{file.relative_to(ROOT)}:{line} imports {module}")
    assert not forbidden, "\n".join(forbidden)
    assert {each.stem for each in compiler.iterdir() if each.stem[0] != "_"} == set(allowed)


def test_no_modules_of_the_compiler_import_each_other_in_a_circle() -> None:
    graph = {
        "servogen." + ".".join(file.relative_to(PACKAGE).with_suffix("").parts): [
            module for _, module in modules_of(file)
        ]
        for file in (PACKAGE / "compiler").rglob("*.py")
    }
    assert (
        components({name: [each for each in named if each in graph] for name, named in graph.items()}) == []
    )


def test_no_class_of_the_compiler_is_a_chapter_of_another() -> None:
    """At most one of our own classes above another, no stub, no dispatch by made-up names."""
    bases: dict[str, list[str]] = {}
    for file in sorted((PACKAGE / "compiler").rglob("*.py")):
        text = file.read_text()
        assert "NotImplementedError" not in text.replace("raise NotImplementedError  # abstract", ""), file
        assert not re.search(r"getattr\([^)]*[\"'] ?\+", text), file
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef):
                bases[node.name] = [each.id for each in node.bases if isinstance(each, ast.Name)]
    deep = [
        name
        for name, above in bases.items()
        if any(grand in bases for each in above if each in bases for grand in bases[each])
    ]
    assert deep == []


def test_a_forbidden_import_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "wrong.py"
    file.write_text("def late() -> None:\n    from servogen.compiler import compile_sources\n")
    assert imports_of(file) == [(2, "compiler")]
    assert not may_import(design_table(), "simulator", "compiler")


TABLES_OF_MNEMONICS = {
    "compiler/codegen/runtime_devices.py": "writes a line low or high",
    "compiler/passes/branch_simplify.py": "DECF and INCF beside the skips that count like them",
    "compiler/passes/jump_threading.py": "each bit test beside its opposite",
    "compiler/sema/builtins.py": "the instructions that have a function in C",
    "pic/known_values.py": "what instructions compute: the second implementation beside the simulator's",
    "pic/wcet.py": "the instructions that count loops",
    "simulator/block_cache.py": "the instructions that a wait may contain",
}
"""Modules that may list mnemonics, and what the list says that no column of `pic.isa` does."""


def test_no_module_types_a_fact_about_instructions_again() -> None:
    """A collection of mnemonics is a fact about them, such as "these skip": it derives from their rows."""
    found = {
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if len(mnemonics_in(node)) > 1
    }
    assert found == set(TABLES_OF_MNEMONICS)


def test_a_collection_of_mnemonics_is_seen() -> None:
    for text in ('("GOTO", "CALL")', '{"BCF": 1, "BSF": 2}', '["RETURN", x, "RETFIE"]', '{"SLEEP", "NOP"}'):
        assert any(len(mnemonics_in(node)) == 2 for node in ast.walk(ast.parse(text))), text


def mnemonics_in(node: ast.AST) -> list[str]:
    """The mnemonics among the elements of a collection that is written out."""
    elements: list[ast.expr | None] = []
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        elements = [*node.elts]
    elif isinstance(node, ast.Dict):
        elements = [*node.keys]
    values = [each.value for each in elements if isinstance(each, ast.Constant)]
    return [each for each in values if isinstance(each, str) and each in by_mnemonic()]


def modules_of(file: Path) -> list[tuple[int, str]]:
    """(line, module) of each import of servogen's modules."""
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("servogen"):
            found.append((node.lineno, node.module))
        elif isinstance(node, ast.Import):
            found += [(node.lineno, each.name) for each in node.names if each.name.startswith("servogen")]
    return found


def design_table(first_column: str = "package") -> dict[str, set[str]]:
    """Package (or stage of the compiler) -> those that the design's table lets it import."""
    rows = {}
    table = ""
    for line in (ROOT / "docs" / "design.md").read_text().splitlines():
        heading = re.match(r"\| (package|stage) \|", line)
        table = heading[1] if heading else table
        if line.startswith("| `") and table == first_column:
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
