"""Constants in flash, read by an index, through pointers and in several bytes, at the ends of tables."""

from __future__ import annotations

from servogen.compiler import Options, Source, compile_sources
from servogen.pic.device import RAM_FIRST
from servogen.simulator import Machine
from servogen.units import Clock
from tests.compiler.cases import every


def results(text: str, count: int) -> list[int]:
    """The bytes of `unsigned char out[count]` when the program has come to its end."""
    made = compile_sources(
        [Source("#include <xc.h>\n" + text, "main.c")], Options(dialect="xc8", clock_hz=4_000_000)
    )
    machine = Machine(made.image, Clock(4_000_000))
    machine.run(60_000)
    start = next(address for address, name, _ in made.listing.variables if name == "out") - RAM_FIRST
    return list(machine.state().ram[start : start + count])


def body(index: int) -> int:
    return index * 7 + 3 & 0xFF


@every("length", [40, 256, 257, 300])
def test_every_end_of_a_table(length: int) -> None:
    rows = ", ".join(str(body(at)) for at in range(length))
    places = [0, 1, length // 2, length - 2, length - 1]
    if length > 256:
        places += [255, 256]
    reads = "".join(f"i = {at}; out[{number}] = big[i]; " for number, at in enumerate(places))
    reads += f"i = {length - 2}; out[8] = big[i + 1]; out[9] = big[3];"
    text = (
        f"const unsigned char big[{length}] = {{{rows}}}; volatile unsigned int i; unsigned char out[10];\n"
    )
    found = results(f"{text}void main(void) {{ {reads} while (1); }}", 10)
    assert found[: len(places)] == [body(at) for at in places]
    assert found[8:] == [body(length - 1), body(3)]


def test_up_to_256_bytes_are_read_with_an_index_of_one_byte() -> None:
    def words(length: int) -> int:
        text = f"const unsigned char big[{length}] = {{1, 2}}; volatile unsigned int i; volatile char n;\n"
        text += "void main(void) { i = 1; n = big[i]; while (1); }"
        options = Options(dialect="xc8", clock_hz=4_000_000)
        return compile_sources([Source("#include <xc.h>\n" + text, "main.c")], options).words - length

    assert words(254) == words(255) == words(256) < words(257)


def test_objects_of_several_bytes_and_pointers_to_flash_and_ram() -> None:
    text = """
    struct row { unsigned char key; unsigned int value; signed char less; };
    const struct row rows[3] = {{1, 0x1234, -1}, {2, 0x5678, -2}, {3, 0x9ABC, -3}};
    const unsigned long longs[2] = {0x01020304, 0xA0B0C0D0};
    const signed char small[2] = {-5, 6};
    const unsigned char *const names[2] = {"ab", "cd"};
    const unsigned int next[3] = {0x0102, 2, 0x0304};
    unsigned char ram[3] = {50, 60, 70}, out[24];
    volatile unsigned char i;
    const unsigned char *p;
    const unsigned int *w;
    const struct row *q;
    void main(void) {
      unsigned int u; unsigned long l; int s;
      i = 1; u = rows[i].value; out[0] = u; out[1] = u >> 8;
      i = 2; out[2] = rows[i].key; s = rows[i].less; out[3] = s; out[4] = s >> 8;
      i = 1; l = longs[i]; out[5] = l; out[6] = l >> 8; out[7] = l >> 16; out[8] = l >> 24;
      i = 0; s = small[i]; out[9] = s >> 8; i = 1; s = small[i]; out[10] = s; out[11] = s >> 8;
      p = ram; out[12] = p[1]; p = names[i]; out[13] = *p; out[14] = p[1]; p++; out[15] = *p;
      q = &rows[1]; u = q->value; out[16] = u >> 8; q++; out[17] = q->less; out[18] = (q - 1)->key;
      w = &rows[0].value; u = *w; out[19] = u;
      u = i; u = next[u]; u = next[u]; out[20] = u; out[21] = u >> 8;
      u = next[i - 1]; u = next[u >> 8]; out[22] = u; out[23] = u >> 8;
      while (1);
    }
    """
    assert results(text, 24) == [
        *(0x78, 0x56, 3, 0xFD, 0xFF), *(0xD0, 0xC0, 0xB0, 0xA0), *(0xFF, 6, 0),
        *(60, ord("c"), ord("d"), ord("d")), *(0x56, 0xFD, 2, 0x34), *(0x04, 0x03, 2, 0),
    ]  # fmt: skip
