"""The imports between packages are the ones that docs/design.md allows, and no others."""

import ast
import gc
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

from servogen.graph import components
from servogen.pic.isa import by_mnemonic

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "servogen"
EVERYTHING = "everything"


@pytest.fixture(scope="module", autouse=True)
def _trees_are_forgotten() -> Iterator[None]:
    """Once this module's tests have read them: there are a million nodes, none of them garbage before."""
    gc.disable()
    yield
    gc.enable()
    tree_of.cache_clear()
    nodes_of.cache_clear()


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


@cache
def nodes_of(tree: ast.Module) -> tuple[ast.AST, ...]:
    """The nodes of a module, which several tests look through."""
    return (*ast.walk(tree),)


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
    rooms = {room_of(file) for file in PACKAGE.rglob("*.py")}
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


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Otherwise it depends on the module that is imported first whether it can be imported at all. A circle
    only of types says that two modules cannot be read one after the other.
    """
    graph = {module_of(file): modules_of(file) for file in PACKAGE.rglob("*.py")}
    assert components({name: [*first_imported(name, named, graph)] for name, named in graph.items()}) == []


def test_a_circle_through_a_package_is_seen() -> None:
    """protocol imports player.buttons, and thereby player, whose start imports what imports protocol."""
    named = {
        "protocol": ["player.buttons"],
        "player": ["player.start"],
        "player.buttons": [],
        "player.start": ["protocol"],
    }
    graph = {name: [(1, module) for module in modules] for name, modules in named.items()}
    circles = components({name: [*first_imported(name, found, graph)] for name, found in graph.items()})
    assert [set(circle) for circle in circles] == [{"protocol", "player", "player.start"}]


def test_an_import_for_a_type_checker_counts(tmp_path: Path) -> None:
    file = tmp_path / "typed.py"
    file.write_text("if TYPE_CHECKING:\n    from servogen.prove.nodes import Node\n")
    assert modules_of(file) == [(2, "servogen.prove.nodes")]


def module_of(file: Path) -> str:
    """The name by which a module, or a package, is imported."""
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def first_imported(name: str, named: Iterable[tuple[int, str]], graph: Collection[str]) -> Iterator[str]:
    """The modules that a module needs, and the packages around them, but for those around itself."""
    for _, module in named:
        parts = module.split(".")
        for end in range(1, len(parts) + 1):
            needed = ".".join(parts[:end])
            if needed in graph and not f"{name}.".startswith(f"{needed}."):
                yield needed


def test_no_class_is_a_chapter_of_another() -> None:
    """At most one of our own classes above another; a class with a single heir is also used itself.

    `answers` has no classes with code: its types are sets of keys, which an answer has beside its own.
    """
    files = sorted(file for file in PACKAGE.rglob("*.py") if file != PACKAGE / "answers.py")
    assert chapters([tree_of(file) for file in files]) == []


def test_a_chapter_is_seen() -> None:
    chain = "class A:\n pass\nclass B(A):\n pass\nclass C(B):\n pass\nx = A(), B(), C()"
    assert chapters([ast.parse(chain)]) == ["C is the third of A, B, C"]
    cut = "class Base:\n pass\nclass Whole(Base[int]):\n pass\nx = Whole()"
    assert chapters([ast.parse(cut)]) == ["Base is only the beginning of Whole"]
    kinds = "class Base:\n pass\nclass One(Base):\n pass\nclass Two(Base):\n pass"
    assert chapters([ast.parse(kinds)]) == []
    beside = "class A:\n pass\nclass B:\n pass\nclass C(A, B):\n pass\nx = A(), B()"
    assert chapters([ast.parse(beside)]) == []


def chapters(trees: list[ast.Module]) -> list[str]:
    """The classes that continue, or only begin, another one, in sentences."""
    bases: dict[str, list[str]] = {}
    called = set()
    for tree in trees:
        for node in nodes_of(tree):
            if isinstance(node, ast.ClassDef):
                found = [each.value if isinstance(each, ast.Subscript) else each for each in node.bases]
                bases.setdefault(node.name, []).extend(
                    each.id for each in found if isinstance(each, ast.Name)
                )
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                called.add(node.func.id)
    own = {name: [each for each in above if each in bases] for name, above in bases.items()}
    problems = []
    for name, above in own.items():
        line = longest(name, own)
        if len(line) > 1:
            problems.append(f"{name} is the third of {', '.join([*reversed(line), name])}")
        for base in above:
            heirs = [each for each, bases_of in own.items() if base in bases_of]
            used = base in called or {"ABC", "Protocol"} & set(bases[base])
            if heirs == [name] and not used:
                problems.append(f"{base} is only the beginning of {name}")
    return problems


def longest(name: str, own: dict[str, list[str]]) -> list[str]:
    """The longest chain of our own classes above a class, nearest first."""
    chains = [[base, *longest(base, own)] for base in own[name] if base != name]
    return max(chains, key=len, default=[])


SAME_NAME = {
    "DirectionButtons": "the checker reads schedules with classes of its own",
    "StepButton": "the checker reads schedules with classes of its own",
    "FrameTable": "[frame] of a job, a fixed frame of a robot's file: the tables' names in TOML",
    "SupplyTable": "[supply] of a job, [[supply]] of a servo's file: the tables' names in TOML",
}
"""Public classes that share a name, and why."""


COMMAND_LINES = 60


def test_a_command_is_parse_call_and_show() -> None:
    """What is longer does something that a workflow should do, or declares options that belong together."""
    lengths = {
        f"{file.name}:{node.lineno} {node.name}": (node.end_lineno or 0) - node.lineno + 1
        for file in sorted((PACKAGE / "cli").glob("*.py"))
        for node in nodes_of(tree_of(file))
        if isinstance(node, ast.FunctionDef)
    }
    assert len(lengths) > 100
    assert [name for name, length in lengths.items() if length > COMMAND_LINES] == []


IMPORTED_WHEN_NEEDED = {
    "drive_command.py": 1,  # only a walk on command needs its chip, and with it the compiler
    "grade_commands.py": 2,  # the server, twins and provers, where a class is watched
    "main.py": 1,  # the version is printed without typer
    "files.py": 3,  # a HEX file is simulated without the compiler and the engines
    "job_commands.py": 1,  # a job of one chip is checked without the simulator, which plans two
    "page_server.py": 6,  # the server's package may be missing
    "show.py": 7,  # rich, where a table or a bar is shown
}
"""The imports within functions of the command line, by module."""


def test_commands_import_at_their_top() -> None:
    """Only the called command is loaded, and says at its top what it needs."""
    inside = Counter(
        file.name
        for file in (PACKAGE / "cli").glob("*.py")
        for function in nodes_of(tree_of(file))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    )
    assert inside == IMPORTED_WHEN_NEEDED


def test_one_name_means_one_class() -> None:
    """Otherwise a reader who searches for a name finds several things."""
    definitions = [name for file in PACKAGE.rglob("*.py") for name in public_classes(tree_of(file))]
    assert {name for name, count in Counter(definitions).items() if count > 1} == set(SAME_NAME)


def test_every_public_class_is_seen() -> None:
    assert public_classes(ast.parse("class A:\n class B: pass\nclass _C: pass")) == ["A", "B"]


def public_classes(tree: ast.Module) -> list[str]:
    """Return the names of the classes that do not begin with an underscore."""
    return [
        node.name
        for node in nodes_of(tree)
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    ]


def test_there_is_no_stub_and_no_dispatch_by_computed_names() -> None:
    problems = [
        f"{file.relative_to(ROOT)}:{line} {what}"
        for file in sorted(PACKAGE.rglob("*.py"))
        for line, what in stubs(tree_of(file))
    ]
    assert problems == []


def test_stubs_and_dispatch_by_computed_names_are_seen() -> None:
    for text in (
        "raise NotImplementedError",
        "raise NotImplementedError('later')",
        "getattr(self, '_do_' + name)(node)",
        "handler = getattr(self, f'_do_{name}')",
        "getattr(visitor, name)(node)",
    ):
        assert stubs(ast.parse(text)), text
    assert not stubs(ast.parse("value = getattr(table, f'{name}_pin')"))  # a field, not a method


def stubs(tree: ast.Module) -> list[tuple[int, str]]:
    """(line, what) of each method that is left out, and of each that is found by a name that is computed."""
    found = []
    for node in nodes_of(tree):
        match node:
            case ast.Name("NotImplementedError"):
                found.append((node.lineno, "NotImplementedError"))
            case ast.Call(ast.Call(ast.Name("getattr"), [_, name, *_])) if not isinstance(name, ast.Constant):
                found.append((node.lineno, "a call by a computed name"))
            case ast.Call(ast.Name("getattr"), [ast.Name("self" | "cls"), ast.BinOp() | ast.JoinedStr(), *_]):
                found.append((node.lineno, "a method by a computed name"))
    return found


LATE_IMPORTS = {
    "__main__.py": "the interpreter's version is checked before anything that needs a newer one",
    "bench/ports.py": "start-up time: only programming and driving need pyserial",
    "bench/programmers/picpro.py": "runs in a process of its own, with a package of that process",
    "bench/programmers/table.py": "start-up time: only reading back needs intelhex",
    "cli/": "start-up time: a command loads only what it runs",
    "engines/player/engine.py": "start-up time: only making the firmware needs the compiler",
    "engines/sequence/engine.py": "start-up time: only making the firmware needs the compiler",
    "engines/stream/engine.py": "start-up time: only making the firmware needs the compiler",
    "engines/tape/engine.py": "start-up time: only making the firmware needs the compiler",
    "job/plan.py": "start-up time: only a job with a program needs the command language",
    "kinematics/symbolic.py": "sympy is an optional extra",
    "kinematics/urdf.py": "urdf-parser-py is an optional extra",
    "programs.py": "start-up time: the compiler, the assembler and schedules are for different files",
    "recordings/documents.py": "pyyaml is an optional extra",
    "report/film.py": "matplotlib is an optional extra",
    "report/pictures.py": "matplotlib is an optional extra",
    "testing/plugin.py": "start-up time: pytest loads the plugin for every project",
    "toml/locations.py": "start-up time: only a file with an error needs the parser that knows lines",
    "twin/world.py": "MuJoCo is an optional extra",
    "traces/formats.py": "start-up time: only the format of the file is loaded",
}
"""Where imports may stand inside functions, and why."""


def test_imports_stand_at_the_top_unless_a_reason_is_given() -> None:
    late = {
        name if not name.startswith("cli/") else "cli/"
        for file in PACKAGE.rglob("*.py")
        for name in [file.relative_to(PACKAGE).as_posix()]
        if late_imports(tree_of(file))
    }
    assert late == set(LATE_IMPORTS)


def test_a_late_import_is_seen() -> None:
    assert late_imports(ast.parse("def f():\n if x:\n  import numpy")) == [(3, "numpy")]
    assert late_imports(ast.parse("class A:\n def f(self):\n  from os import path")) == [(3, "os")]
    assert late_imports(ast.parse("import os\nif os.name == 'posix':\n import fcntl")) == []


def late_imports(tree: ast.Module) -> list[tuple[int, str]]:
    """(line, module) of each import inside a function."""
    functions = [each for each in nodes_of(tree) if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)]
    found = {}
    for node in (inner for function in functions for inner in ast.walk(function)):
        if isinstance(node, ast.ImportFrom):
            found[node.lineno] = node.module or ""
        elif isinstance(node, ast.Import):
            found[node.lineno] = node.names[0].name
    return sorted(found.items())


def test_a_forbidden_import_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "wrong.py"
    file.write_text("def late() -> None:\n    from servogen.compiler import compile_sources\n")
    assert imports_of(file) == [(2, "compiler")]
    assert not may_import(design_table(), "simulator", "compiler")


TABLES_OF_MNEMONICS = {
    "checker/chip.py": "the registers that instructions without an address write",
    "checker/layout.py": "the operations of the checker's chip, which it shares with nobody",
    "compiler/codegen/runtime.py": "writes a line low or high",
    "compiler/passes/branch_simplify.py": "DECF and INCF beside the skips that count like them",
    "compiler/passes/jump_threading.py": "each bit test beside its opposite",
    "compiler/sema/builtins.py": "the instructions that have a function in C",
    "pic/analysis/state.py": "the instructions that copy a byte, and those that compare or count",
    "pic/known_values.py": "the instructions that it does not follow",
    "pic/semantics.py": "what instructions compute",
    "pic/wcet.py": "the instructions that count loops",
    "simulator/regions.py": "the instructions that a wait may contain",
}
"""Modules that may list mnemonics, and what the list says that no column of `pic.isa` does."""


def test_no_module_types_a_fact_about_instructions_again() -> None:
    """A collection of mnemonics is a fact about them, such as "these skip": it derives from their rows."""
    found = {
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        for node in nodes_of(tree_of(file))
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
    """(line, module) of each import of servogen's modules, those for a type checker included."""
    found = []
    for node in nodes_of(tree_of(file)):
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
    """The package (or leaf module) of a file of servogen."""
    return file.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports_of(file: Path) -> list[tuple[int, str]]:
    """(line, package of servogen) of each import, wherever it stands in the file."""
    found = []
    for node in nodes_of(tree_of(file)):
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


OF_OTHER_PROTOCOLS = {"_repr_html_", "_repr_svg_", "_replace", "_asdict", "_exit", "_axis_map"}
"""Of notebooks, named tuples and `os`, and what Matplotlib has in no other way."""


def private_uses(tree: ast.Module) -> Iterator[str]:
    """What a test takes from another module or object by a private name: line and name.

    A name that the file itself makes is its own.
    """
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(names=names):
                used = [each.name for each in names]
            case ast.Attribute(value=ast.Name("self" | "cls")):
                continue
            case ast.Attribute(attr=name):
                used = [name]
            case _:
                continue
        for name in used:
            private = name.startswith("_") and not name.startswith("__")
            if private and name not in own | OF_OTHER_PROTOCOLS:
                yield f"{node.lineno}: {name}"


def test_no_test_takes_what_is_private_of_another_object() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{use}"
        for file in sorted((ROOT / "tests").rglob("*.py"))
        for use in private_uses(tree_of(file))
    ]
    assert not found, "\n".join(found)


def test_a_private_name_of_another_object_is_seen() -> None:
    text = "from a import _b, c\nself._d = c.e._f\ndef _g(): ...\nc._g\nc.__dict__\nc._repr_html_()\n"
    assert [*private_uses(ast.parse(text))] == ["1: _b", "2: _f"]
