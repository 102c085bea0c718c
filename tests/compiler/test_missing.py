"""What docs/compiler.md lists as missing is refused with an error that names it."""

from __future__ import annotations

import pytest

from servogen.compiler import Options, Source, compile_sources
from servogen.errors import InputError

END = "void main(void) { }\n"
MISSING = {
    "recursion": ("int f(int n) { return n ? f(n - 1) : 0; }\nvoid main(void) { f(3); }", "recursion"),
    "64 bits": (f"long long a;\n{END}", "64-bit"),
    "variable arguments": (f"int f(int a, ...) {{ return a; }}\n{END}", "'...' parameters"),
    "stdarg.h": (f"#include <stdarg.h>\n{END}", "'stdarg.h'"),
    "variable length": ("void f(char n) { char a[n]; a[0] = 1; }\nvoid main(void) { f(2); }", "constant"),
    "malloc": ("#include <stdlib.h>\nvoid main(void) { malloc(3); }", "'malloc'"),
    "wide field": (f"struct {{ unsigned long a : 17; }} s;\n{END}", "1 to 16 bits"),
    "empty structure": (f"struct s {{ }} a;\n{END}", "a structure needs a member"),
    "designators": (f"struct {{ struct {{ char x; }} a; }} s = {{ .a.x = 1 }};\n{END}", "designators"),
    "generic": ("int a;\nvoid main(void) { a = _Generic(a, int: 1); }", "generic"),
    "case range": ("char a;\nvoid main(void) { switch (a) { case 1 ... 3: a = 0; } }", "'...'"),
    "typeof": ("char a;\nvoid main(void) { __typeof__(a) b; b = 1; a = b; }", "syntax error"),
    "statement expression": ("int a;\nvoid main(void) { a = ({ 1; }); }", "compound"),
    "computed goto": ("void main(void) { void *p = &&x; x: ; }", "'&&'"),
    "line": (f'#line 5 "x.c"\n{END}', "#line"),
    "float format": ('#include <stdio.h>\nchar b[9];\nvoid main(void) { sprintf(b, "%f", 1.5); }', "%f"),
    "precision": ('#include <stdio.h>\nchar b[9];\nvoid main(void) { sprintf(b, "%.2d", 1); }', "%.2d"),
    "format": ("#include <stdio.h>\nchar b[9];\nvoid main(void) { sprintf(b, b, 1); }", "string constant"),
    "scanf": ('#include <stdio.h>\nint a;\nvoid main(void) { scanf("%d", &a); }', "'scanf'"),
    "strtok": ('#include <string.h>\nchar b[5];\nvoid main(void) { strtok(b, ","); }', "'strtok'"),
    "sine": ("#include <math.h>\nfloat a;\nvoid main(void) { a = sin(a); }", "'sin'"),
    "assert.h": (f"#include <assert.h>\n{END}", "'assert.h'"),
    "pointer into the EEPROM": ("__eeprom char t[3];\nvoid main(void) { char *p = t; *p = 1; }", "EEPROM"),
    "address of a bit": ("bit b;\nvoid main(void) { &b; }", "a bit has no address"),
    "assembly outside functions": (f'asm("nop");\n{END}', "outside functions"),
    "assembly with operands": ('void main(void) { asm("movlw %0" : : "i"(5)); }', "operands"),
    "delay": ("void main(void) { delay_ms(300); }", "0 to 255"),
    "mikroC": ("void main(void) { TRISB.F0 = 0; }", "written for mikroC"),
    "CCS C": (f"#include <16F84A.h>\n#use delay(clock=4000000)\n{END}", "written for CCS C"),
}


@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_is_refused_and_named(name: str) -> None:
    text, said = MISSING[name]
    dialect = "c2c" if name in ("delay", "mikroC", "CCS C") else "xc8"
    with pytest.raises(InputError) as caught:
        compile_sources([Source(text)], Options(dialect, clock_hz=4_000_000))
    errors = [each.message for each in caught.value.diagnostics if each.severity == "error"]
    assert any(said in each for each in errors), errors


OTHERS = {
    "mikroC": "sbit LED at RB0_bit;\nvoid main() { TRISB = 0; LED = 1; Delay_ms(500); PORTB.F1 = 0; }",
    "CCS C": "#include <16F84A.h>\n#fuses XT\n#use delay(clock=4M)\nvoid main() { output_low(PIN_B0); }",
    "Arduino": "void setup() { pinMode(13, OUTPUT); }\nvoid loop() { digitalWrite(13, HIGH); delay(500); }",
    "Arduino  ": "#include <Servo.h>\nServo s;\nvoid setup() { s.attach(9); }\nvoid loop() { s.write(30); }",
    "Arduino ": "void setup() { }\n\nvoid loop() { }",
}


@pytest.mark.parametrize("name", OTHERS)
def test_a_source_for_another_compiler_has_one_error_that_names_it(name: str) -> None:
    with pytest.raises(InputError) as caught:
        compile_sources([Source(OTHERS[name])], Options("c2c"))
    (error,) = caught.value.diagnostics
    assert error.code == "c-dialect"
    assert error.message == f"this is written for {name.strip()}, another compiler"
    assert error.hint == "there are the dialects C2C, XC8, SDCC"


def test_words_of_another_compiler_in_a_source_of_ours_are_errors_of_their_own() -> None:
    """The header of a dialect says for which compiler it is; and what compiles is not looked at."""
    with pytest.raises(InputError, match="'Delay_ms' is not declared"):
        compile_sources([Source("#include <xc.h>\nvoid main(void) { Delay_ms(5); }")], Options("xc8"))
    own = "void Delay_ms(char n) { PORTB = n; }\nvoid main(void) { Delay_ms(5); }"
    compile_sources([Source(own)], Options("c2c"))
