"""Whatever is in a file, it is read or refused with an InputError that names it; nothing else is raised."""

import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from servogen.edges import EdgeTrace, join
from servogen.errors import InputError
from servogen.traces import read_edges
from servogen.traces.captures import read_capture
from servogen.units import Clock
from tests.campaigns import sampled

VCD = (
    b"$timescale 1 us $end\n$scope module top $end\n$var wire 1 ! RB0 $end\n$var reg 8 # bus $end\n"
    b"$upscope $end\n$enddefinitions $end\n#0\n$dumpvars\n0!\nb0000 #\n$end\n#5 1!\n"
    b"$comment no $end\n#7\n0!\nb1 #\n#12\n"
)
WHOLE = {
    "a.csv": b"cycle,pin,level\n5,RB0,1\n10,RB0,0\n100,RA4,1\n",
    "a.jsonl": b'{"cycle":5,"pin":"RB0","level":1}\n{"cycle":10,"pin":"RB0","level":"z"}\n',
    "a.vcd": VCD,
}


def session() -> bytes:
    """A sigrok session of three samples."""
    file = BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("metadata", "[device 1]\nsamplerate=1 MHz\nprobe1=RB0\nunitsize=1\n")
        archive.writestr("logic-1-1", b"\0\1\0")
    return file.getvalue()


CAPTURED = {"a.csv": b"Time [s],RB0,RB1\n-0.1,0,1\n0.5,1,1\n1.25,0,X\n", "a.vcd": VCD, "a.sr": session()}


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """`whole` with some bytes changed, dropped or put in, or cut short."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(0, len(data) - 1)))
        kind = draw(st.sampled_from(["change", "drop", "insert", "cut", "double"]))
        if kind == "change" and data:
            data[at] = draw(st.one_of(st.integers(0, 255), st.sampled_from(b'0123456789,#!$ \n\r"-zbR')))
        elif kind == "drop":
            del data[at : at + draw(st.integers(1, 6))]
        elif kind == "insert":
            data[at:at] = draw(st.binary(max_size=4))
        elif kind == "cut":
            del data[at:]
        else:
            data[at:at] = data[at : at + 20]
    return bytes(data)


def read_or_refuse(read: Callable[[Path], EdgeTrace], name: str, data: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(data)
        try:
            trace = read(path)
            edges = join(trace.chunks)
        except InputError as error:
            assert error.location is not None
            assert error.location.file == str(path)
            return
        assert edges.cycle.tolist() == sorted(edges.cycle.tolist())
        assert not len(edges.cycle) or 0 <= edges.cycle[0] <= edges.cycle[-1] < trace.end


@pytest.mark.parametrize("name", sampled(WHOLE))
@settings(max_examples=200)
@given(data=st.data())
def test_edges(name: str, data: st.DataObject) -> None:
    contents = data.draw(damaged(WHOLE[name]))
    read_or_refuse(lambda path: read_edges(path, Clock(4_000_000)), name, contents)


@pytest.mark.parametrize("name", sampled(CAPTURED))
@settings(max_examples=150)
@given(data=st.data())
def test_captures(name: str, data: st.DataObject) -> None:
    contents = data.draw(damaged(CAPTURED[name]))
    read_or_refuse(lambda path: read_capture(path).trace, name, contents)
