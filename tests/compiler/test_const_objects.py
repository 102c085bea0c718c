"""Constant objects in flash, reached in every way, and declarations of one object in several places."""

from __future__ import annotations

import pytest

from servogen.compiler import Compilation, Options, Source, compile_sources
from servogen.compiler.driver import LEVELS
from servogen.compiler.frontend.dialects import DIALECTS
from servogen.errors import InputError
from tests.campaigns import sampled
from tests.compiler.bus import Bus

WHERE = [(dialect, level) for dialect in DIALECTS for level in LEVELS][::2]
"""Each dialect and each level, most with two of the other."""
EVERYWHERE = sampled([(where,) for where in WHERE], 2)
PORTB = 0x06
HEADS = {"c2c": "", "xc8": "#include <xc.h>\n", "sdcc": "#include <pic14/pic16f84a.h>\n"}


def build(texts: list[str], where: tuple[str, str]) -> Compilation:
    dialect, level = where
    sources = [Source(HEADS[dialect] + text, f"part{number}.c") for number, text in enumerate(texts)]
    return compile_sources(sources, Options(dialect=dialect, optimise=level))


def shown(texts: list[str], where: tuple[str, str]) -> list[int]:
    """What the program stores in PORTB."""
    return stored(build(texts, where))


def stored(found: Compilation) -> list[int]:
    return [each.value for each in Bus(found.image, [PORTB], {}, PORTB).run() if each.kind == "store"]


MENU = """
typedef struct { unsigned char id; char text[4]; unsigned int n[2]; } Menu;
typedef char Name[4];
struct inner { Name name; };
const Menu menu[3] = {{1, "abc", {1, 2}}, {2, "def", {300, 400}}, {3, "ghi", {5, 6}}};
const struct { unsigned char first; struct inner in; } deep = {9, {"xyz"}};
const Name names[2] = {"pqr", "stu"};
const struct { unsigned x : 1; unsigned d : 7; } pad[2] = {{0, 3}, {1, 2}}, one = {1, 2};
const struct { signed char low : 3; signed char high : 1; } sign[2] = {{3, 0}, {-2, -1}};
char ram[4] = "jkl";
unsigned char i = 1;
const Menu *m;
const char *t;
void put(const char *s) { while (*s) PORTB = *s++; }
void numbers(const unsigned int *p) { PORTB = p[0] >> 8; PORTB = p[1]; }
unsigned char odd(const Menu *p) { return p->text[i] + p->n[i]; }
"""
READS = {
    "put(menu[1].text);": b"def", "put(menu[i].text);": b"def", "put(&menu[i].text[1]);": b"ef",
    "put(menu[i].text + i);": b"ef", "m = &menu[2]; put(m->text);": b"ghi",
    "m = menu; m++; put(m->text);": b"def", "t = menu[i].text; put(t);": b"def",
    "put((menu + i)->text);": b"def", "put((*m).text);": b"def",
    "put(i ? menu[0].text : menu[1].text);": b"abc",
    "put(deep.in.name);": b"xyz", "put(names[i]);": b"stu", "put(ram);": b"jkl",
    "PORTB = menu[i].text[2];": b"f", "PORTB = *menu[i].text;": b"d", "PORTB = m->text[i];": b"e",
    "numbers(menu[i].n);": bytes((300 >> 8, 400 & 0xFF)),
    "numbers(m->n);": bytes((300 >> 8, 400 & 0xFF)),
    "PORTB = odd(m);": bytes((ord("e") + 400 & 0xFF,)),
    "PORTB = sizeof(menu[i].text);": bytes((4,)),
}  # fmt: skip


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_an_array_in_a_constant_structure_is_read_from_flash(where: tuple[str, str]) -> None:
    statements = list(READS)
    for part in (statements[:10], statements[10:]):
        body = "m = &menu[i]; " + " ".join(part)
        expected = b"".join(READS[each] for each in part)
        assert bytes(shown([f"{MENU}void main(void) {{ {body} }}"], where)) == expected


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_pointer_that_reads_both_memories_starts_at_a_moved_address(where: tuple[str, str]) -> None:
    """The addresses are constants (ISO C 6.6), of RAM and flash, converted before and after they move."""
    text = """
    unsigned char y[5] = {1, 2, 3, 4, 5};
    const unsigned char z[5] = {6, 7, 8, 9, 10};
    const unsigned char *a = (const unsigned char *)y + 1, *b = (const unsigned char *)(y + 3) - 1;
    const unsigned char *c = (const unsigned char *)&z[1] + 2, *d = z + 1;
    void main(void) { PORTB = *a; PORTB = *b; PORTB = *c; PORTB = *d; }
    """
    assert shown([text], where) == [2, 3, 9, 7]


FIELDS = {
    "PORTB = pad[i].x;": 1, "PORTB = pad[i].d;": 2, "PORTB = pad[0].x;": 0, "PORTB = pad[0].d;": 3,
    "if (pad[i].x) PORTB = 1; else PORTB = 0;": 1,
    "if (!pad[i].x) PORTB = 1; else PORTB = 0;": 0,
    "if (pad[!i].x) PORTB = 1; else PORTB = 0;": 0,
    "if (one.x) PORTB = 1; else PORTB = 0;": 1, "PORTB = one.d + one.x;": 3, "PORTB = sign[i].low;": 0xFE,
    "PORTB = sign[1].low;": 0xFE, "PORTB = sign[1].high;": 0xFF, "PORTB = sign[i].high;": 0xFF,
    "PORTB = (&pad[i])->x;": 1, "PORTBbits.RB0 = pad[!i].x;": 0, "PORTB = i && pad[i].x;": 1,
}  # fmt: skip


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_bit_field_of_a_constant_object_is_read_from_flash(where: tuple[str, str]) -> None:
    body = " ".join(FIELDS)
    assert shown([f"{MENU}void main(void) {{ {body} }}"], where) == list(FIELDS.values())


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_field_through_a_pointer_is_read_where_it_lies(where: tuple[str, str]) -> None:
    text = """
    struct s { unsigned x : 1; unsigned d : 3; };
    const struct s here[2] = {{0, 5}, {1, 6}};
    struct s there = {1, 2};
    unsigned char i = 1;
    unsigned char get(const struct s *p) { return p->x ? p->d : 0x80 + p->d; }
    void main(void) { PORTB = get(&here[i]); PORTB = get(here); PORTB = get(&there); }
    """
    assert shown([text], where) == [6, 0x85, 2]


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_constant_of_another_file_is_read_from_flash(where: tuple[str, str]) -> None:
    shape = "struct s { unsigned x : 1; unsigned d : 3; char t[3]; };\n"
    first = shape + (
        "extern const struct s there; extern const struct s all[2]; unsigned char i = 1;\n"
        "void main(void) { PORTB = there.x; PORTB = there.d; if (all[i].x) PORTB = all[i].t[i];\n"
        "  PORTBbits.RB7 = there.x; }"
    )
    second = shape + 'const struct s there = {1, 6, "uv"}, all[2] = {{0, 0, ""}, {1, 2, "wx"}};'
    expected = [1, 6, ord("x"), ord("x") | 0x80]
    assert shown([first, second], where) == expected
    assert shown([second, first], where) == expected


@pytest.mark.parametrize("where", EVERYWHERE, ids="-".join)
def test_a_constant_pointer_keeps_what_it_points_to(where: tuple[str, str]) -> None:
    text = """
    char k, list[3];
    char * const q = &k;
    char * const ends[2] = {&list[0], &list[2]};
    char * const * const table = ends;
    unsigned char i = 1;
    void main(void) { *q = 5; PORTB = *q; *ends[i] = 7; PORTB = *ends[1]; PORTB = **(table + i); }
    """
    assert shown([text], where) == [5, 7, 7]


def variable(found: Compilation, name: str) -> int:
    return next(address for address, shown, _ in found.listing.variables if shown == name)


USE = "void main(void) { fails = 3; PORTB = fails; }"
USE_ARRAY = "unsigned char i = 1; void main(void) { fails[i] = 3; PORTB = fails[1]; }"
DECLARED = {
    "__at": ("extern volatile unsigned char fails;", "volatile unsigned char fails __at(0x4D);", USE),
    "@": ("extern unsigned char fails;", "unsigned char fails @ 0x4D;", USE),
    "before": ("extern unsigned char fails;", "__at(0x4D) unsigned char fails;", USE),
    "array": ("extern unsigned char fails[];", "unsigned char fails[2] __at(0x4D);", USE_ARRAY),
    "array @": ("extern unsigned char fails[1 + 1];", "unsigned char fails[1 + 1] @ 0x4D;", USE_ARRAY),
    "length": ("enum { N = 2 }; extern unsigned char fails[N];", "unsigned char fails[2] @ 0x4D;", USE_ARRAY),
    "volatile": ("extern unsigned char fails;", "volatile unsigned char fails @ 0x4D;", USE),
    "twice": ("extern unsigned char fails @ 0x4D;", "unsigned char fails @ 0x4D;", USE),
    "first": ("extern unsigned char fails @ 0x4D;", "unsigned char fails;", USE),
    "local": ("void f(void) { extern unsigned char fails; fails = 1; }", "unsigned char fails @ 0x4D;", USE),
}


def rotated() -> list[tuple[str, tuple[str, str]]]:
    """Each form at every level and in every dialect, which changes from form to form."""
    dialects = list(DIALECTS)
    return [
        (form, (dialects[(number + shift) % len(dialects)], level))
        for number, form in enumerate(DECLARED)
        for shift, level in enumerate(LEVELS)
    ]


@pytest.mark.parametrize(("form", "where"), rotated())
def test_an_address_counts_in_whichever_declaration_it_stands(form: str, where: tuple[str, str]) -> None:
    extern, definition, use = DECLARED[form]
    for texts in (
        [f"{extern}\n{definition}\n{use}"],
        [f"{definition}\n{extern.replace('enum', 'enum e')}\n{use}"],
        [f"{extern}\n{use if form != 'local' else USE.replace('main', 'other')}", definition],
        [definition, f"{extern}\n{use}"],
    ):
        if form == "local" and len(texts) == 2:
            continue  # a block's declaration is not seen outside it
        found = build(texts, where)
        assert variable(found, "fails") == 0x4D
        assert stored(found) == [3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("extern char a @ 0x20;\nchar a @ 0x21;", "'a' has two addresses: 0x20 and 0x21"),
        ("extern const char a;\nchar a = 1;", "'a' is const in one declaration only"),
        ("extern char a;\nconst char a = 1;", "'a' is const in one declaration only"),
        ("const struct { volatile char v; char w; } a = {1, 2};",
            "the constant 'a' cannot have a volatile member"),
        ("char f;\nvoid g(void) { extern int f; f = 1; }", "'f' is already declared"),
        ("const struct { unsigned x : 1; } a = {1};\nvoid g(void) { a.x = 0; }",
            "'a' is const and cannot be changed"),
        ("const struct { unsigned x : 1; } a = {1};\nvoid g(void) { &a.x; }", "a bit has no address"),
        ('const struct { char t[3]; } a = {"x"};\nchar *p;\nvoid g(void) { p = a.t; }',
            "the assignment would drop const: "
            "'const unsigned char *' may point to flash, 'unsigned char *' cannot"),
        (
            'const char a[3] = "x";\nchar *p;\nvoid g(void) { p = (char *) a; }',
            "the cast would drop const: 'const unsigned char *' may point to flash, 'unsigned char *' cannot",
        ),
        ("const char *a[2];\nchar **p;\nvoid g(void) { p = a; }",
            "the assignment makes 'unsigned char * *' from 'const unsigned char * *': "
            "a pointer to const has two bytes, others have one"),
        ("char *a;\nconst char **p;\nvoid g(void) { p = (const char **) &a; }",
            "the cast makes 'const unsigned char * *' from 'unsigned char * *': "
            "a pointer to const has two bytes, others have one"),
        ("char f(const char *s) { return *s; }\nchar (*p)(char *);\nvoid g(void) { p = f; }",
            "the assignment makes 'unsigned char (*)(unsigned char *)' from "
            "'unsigned char (*)(const unsigned char *)': a pointer to const has two bytes, others have one"),
        ("const char *f(void) { return 0; }\nchar *(*const p[1])(void) = {f};",
            "the initialiser makes 'unsigned char * (*)()' from 'const unsigned char * (*)()': "
            "a pointer to const has two bytes, others have one"),
        ("char f(char *s);\nchar f(const char *s) { return *s; }",
            "'f' was declared as 'unsigned char(unsigned char *)' before, "
            "now as 'unsigned char(const unsigned char *)'"),
        ('char last(char **all) { return all[1][0]; }\nchar *a[2] = {"x", "y"};\n'
            "void g(void) { last(a); }",
            "argument 1 of 'last' makes 'unsigned char * *' from 'const unsigned char * *': "
            "a pointer to const has two bytes, others have one"),
        (  # f is called through a pointer, too, whose type says char *
            'char f(char *s) { return *s; }\nchar (*p)(char *) = f;\nvoid g(void) { f("x"); }',
            "argument 1 of 'f' would drop const: "
            "'const unsigned char *' may point to flash, 'unsigned char *' cannot",
        ),
        (  # what is behind `void *` may be written to
            'char *a[1] = {"x"};\nvoid *p;\nvoid g(void) { p = a; }',
            "the initialiser would drop const: "
            "'const unsigned char *' may point to flash, 'unsigned char *' cannot",
        ),
        (  # the declaration in front does not hide that f writes
            'void f(char *);\nvoid g(void) { f("x"); }\nvoid f(char *s) { *s = 1; }',
            "argument 1 of 'f' would drop const: "
            "'const unsigned char *' may point to flash, 'unsigned char *' cannot",
        ),
        ('void f(char *s) { char *t = &s[1]; *t = 1; }\nvoid g(void) { f("x"); }',
            "argument 1 of 'f' would drop const: "
            "'const unsigned char *' may point to flash, 'unsigned char *' cannot"),
    ],
)  # fmt: skip
def test_what_contradicts_is_an_error(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text + "\nvoid main(void) { }", "main.c")])
    assert [each.message for each in caught.value.diagnostics if each.severity == "error"] == [message]
    assert caught.value.diagnostics[0].location.line
