"""Only a program that the chip is too small for "does not fit"; a wrong one is an error of its own."""

import pytest

from servogen.compiler import Options
from servogen.engines.firmware import ResourceError
from servogen.engines.fitting import compiled_to_fit
from servogen.errors import InputError

TOO_MANY_WORDS = f"void main() {{ {'nop(); ' * 1100} }}"
TOO_MUCH_RAM = "char a[40], b[40]; void main() { a[b[0]] = 1; b[a[0]] = 1; }"


@pytest.mark.parametrize("text", [TOO_MANY_WORDS, TOO_MUCH_RAM])
def test_what_the_chip_is_too_small_for_does_not_fit(text: str) -> None:
    with pytest.raises(
        ResourceError, match=r"job: planned, but more than the player can hold: .* chip has"
    ) as e:
        compiled_to_fit(text, "main.c", Options(dialect="c2c"), "job", "the player", "shorten it")
    assert e.value.hint == "shorten it"


@pytest.mark.parametrize("text", ["void main() { x = 1; }", "#define\nvoid main() { }", "void main() { if }"])
def test_what_is_wrong_is_told_as_it_is(text: str) -> None:
    with pytest.raises(InputError) as error:
        compiled_to_fit(text, "main.c", Options(dialect="c2c"), "job", "the player", "shorten it")
    assert not isinstance(error.value, ResourceError)
