"""A node program that cannot be used is named, with the line in it, before anything starts."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import pytest

from lodeline.pipeline.load import PipelineError, load

HEAD = """\
from __future__ import annotations
from dataclasses import dataclass
from lodeline.node import Driver, Input, Node, Output
from lodeline_msgs import Imu

@dataclass(frozen=True)
class NoParams:
    pass

@dataclass(frozen=True)
class Paced:
    rate: float = 10.0
"""

# The program after HEAD (12 lines), and what is said of it.
PROGRAMS: dict[str, tuple[str, str]] = {
    "module that is not installed": (
        "import no_such_module",
        "cannot be imported: own.py:13: ModuleNotFoundError: No module named 'no_such_module'",
    ),
    "name that the library does not have": (
        "def late():\n    from lodeline.node import Nod\nlate()",
        "cannot be imported: own.py:14: ImportError: cannot import name 'Nod'"
        " from 'lodeline.node' ({library}/node.py)",
    ),
    "syntax error": (
        "def broken(:\n    pass",
        "cannot be imported: own.py:13: SyntaxError: invalid syntax (own.py, line 13)",
    ),
    "exit at import": ("\nraise SystemExit(3)", "cannot be imported: own.py:14: SystemExit: 3"),
    "type error at import": (
        "1 + 'a'",
        "cannot be imported: own.py:13: TypeError:"
        " unsupported operand type(s) for +: 'int' and 'str'",
    ),
    "no node class": ("", "{file} must define exactly one node class, found none"),
    "two node classes": (
        "class A(Node[NoParams]): ...\nclass B(Node[NoParams]): ...",
        "{file} must define exactly one node class, found A, B",
    ),
    "input without a handler": (
        "class A(Node[NoParams]):\n    imu = Input(Imu)",
        "own.py: input port 'imu' of A has no handler",
    ),
    "port of no message": (
        'class A(Driver[Paced]):\n    out = Output("Imu")\n    def tick(self, stamp): ...',
        "own.py: port 'out' of A carries the text \"Imu\", which is no message class",
    ),
    "queue for nothing": (
        "class A(Node[NoParams]):\n    imu = Input(Imu, queue=0)\n"
        "    @imu.handler\n    def on_imu(self, imu): ...",
        "own.py: input port 'imu' of A: queue must be a whole number from 1 to 100000, got 0",
    ),
    "age below none": (
        "class A(Node[NoParams]):\n    imu = Input(Imu, max_age=-1)\n"
        "    @imu.handler\n    def on_imu(self, imu): ...",
        "own.py: input port 'imu' of A: max_age must be positive, or None, got -1",
    ),
    "a message's name for another one": (
        "from lodeline_msgs import Message, message\n@message\nclass Imu(Message): ...",
        "cannot be imported: own.py:14: TypeError:"
        " there is a message class Imu already, with other fields",
    ),
    "handler that takes nothing": (
        "class A(Node[NoParams]):\n    imu = Input(Imu)\n"
        "    @imu.handler\n    def on_imu(self): ...",
        "own.py: handler of port 'imu' must take a sample: def on_imu(self, sample)",
    ),
    "tick that takes nothing": (
        "class A(Driver[Paced]):\n    imu = Output(Imu)\n    def tick(self): ...",
        "own.py: driver A must take a stamp: def tick(self, stamp)",
    ),
    "neither input nor tick": (
        "class A(Node[NoParams]):\n    imu = Output(Imu)",
        "own.py: A has no input port and is no Driver: it would never run",
    ),
    "driver that does not tick": (
        "class A(Driver[Paced]):\n    imu = Output(Imu)",
        "own.py: driver A has no tick method",
    ),
    "driver without a rate": (
        "class A(Driver[NoParams]):\n    def tick(self, stamp): ...",
        "own.py: params of driver A have no rate",
    ),
    "node without params": (
        "class A(Node):\n    imu = Input(Imu)",
        "own.py: A does not say what its params are: write Node[Params]",
    ),
    "params that are no dataclass": (
        "class A(Node[int]):\n    imu = Input(Imu)",
        "own.py: params class int is no dataclass",
    ),
    "param that no file can hold": (
        "@dataclass\nclass Odd:\n    when: bytes = b''\nclass A(Node[Odd]):\n    imu = Input(Imu)",
        "own.py: field 'when' of Odd is of type bytes, which no file can hold",
    ),
    "param of a class that is not there": (
        "@dataclass\nclass Odd:\n    when: Nowhere = 0\nclass A(Node[Odd]):\n    imu = Input(Imu)",
        "own.py: name 'Nowhere' is not defined",
    ),
}


def write(folder: Path, program: str) -> Path:
    (folder / "own.py").write_text(program)
    file = folder / "pipeline.yaml"
    file.write_text("name: rig\nexternal: {imu: Imu}\nnodes:\n  own: {run: own.py}\n")
    return file


@pytest.mark.parametrize("case", PROGRAMS)
def test_program_that_cannot_be_used(case: str, tmp_path: Path) -> None:
    program, message = PROGRAMS[case]
    file = write(tmp_path, HEAD + program + "\n")
    with pytest.raises(PipelineError) as caught:
        load(file)
    library = Path(__file__).parents[2] / "lodeline"
    message = message.format(file=tmp_path / "own.py", library=library)
    assert str(caught.value) == f"{file}:4:14: {message}"


def test_what_a_program_prints_when_imported_does_not_mix_with_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = dedent("""
        print("hello from the node")
        class A(Driver[Paced]):
            def tick(self, stamp): ...
    """)
    assert load(write(tmp_path, HEAD + program)).nodes[0].name == "own"
    out, err = capsys.readouterr()
    assert (out, err) == ("", "hello from the node\n")


def test_a_program_that_would_end_at_once_is_told_of_unless_it_shares_a_process(
    tmp_path: Path,
) -> None:
    driver = "class A(Driver[Paced]):\n    def tick(self, stamp): ...\n"
    file = write(tmp_path, HEAD + driver)
    (warning,) = load(file).warnings
    assert warning.startswith(f"{file}:4:14: own.py never runs its node, end it with: if __name__")
    assert warning.endswith("run(A)")
    text = file.read_text()
    both = "{run: own.py, process: both}"
    file.write_text(text.replace("own: {run: own.py}", f"own: {both}\n  other: {both}"))
    assert load(file).warnings == ()
    write(tmp_path, HEAD + driver + 'if __name__ == "__main__":\n    run(A)\n')
    assert load(file).warnings == ()


def test_interruption_during_an_import_is_no_fault_of_the_file(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        load(write(tmp_path, "raise KeyboardInterrupt\n"))


def test_misspelt_program_beside_the_file_is_guessed(tmp_path: Path) -> None:
    file = write(tmp_path, "")
    file.write_text(file.read_text().replace("own.py", "onw.py"))
    with pytest.raises(
        PipelineError, match=r"4:14: onw\.py is neither .* did you mean 'own\.py'\?"
    ):
        load(file)
