"""The command `lodeline VERB ...`: each verb is a program in tools/, as with git and cargo."""

from __future__ import annotations

import ast
import errno
import importlib.util
import os
import select
import sys
from pathlib import Path
from types import ModuleType
from typing import TextIO

from lodeline.loading import shipped
from lodeline.pipeline.faults import PipelineError

FAILED, USAGE, INVALID, INTERRUPTED = 1, 2, 3, 130

EPILOG = """\
`lodeline VERB --help` tells more about a verb.

exit codes: 0 fine, 1 failed, 2 usage, 3 invalid pipeline, 4 nothing there, 5 a node died,
130 interrupted
"""


def main(argv: list[str] | None = None) -> int:
    """Run one verb; its exit code."""
    arguments = sys.argv[1:] if argv is None else argv
    # Python has none where the shell closed it (`>&-`): what is said then is for nobody.
    sys.stdout = sys.stdout or Path(os.devnull).open("w")  # noqa: SIM115
    sys.stderr = sys.stderr or Path(os.devnull).open("w")  # noqa: SIM115
    try:
        code = _run(arguments)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return INTERRUPTED
    except PipelineError as error:
        print(error, file=sys.stderr)
        return INVALID
    except BrokenPipeError:
        # `lodeline ... | head` is no fault, but a broken socket is one.
        if not any([_is_closed(sys.stdout), _is_closed(sys.stderr)]):
            raise
        return FAILED
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        print(f"lodeline: {error.filename or 'output'}: {error.strerror}", file=sys.stderr)
        return FAILED


def _run(arguments: list[str]) -> int:
    verbs = {file.stem: file for file in sorted(shipped("tools").glob("*.py"))}
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_help(verbs))
        return 0 if arguments else USAGE
    if arguments[0] in ("-V", "--version"):
        from importlib.metadata import version

        print(f"lodeline {version('lodeline')}")
        return 0
    verb = arguments[0]
    if verb not in verbs:
        from lodeline.params import nearest

        advice = nearest(verb, verbs) or ": `lodeline --help` lists them"
        print(f"lodeline: unknown verb {verb!r}{advice}", file=sys.stderr)
        return USAGE
    code = _load(verbs[verb]).main(arguments[1:])
    return code if isinstance(code, int) else 0


def _help(verbs: dict[str, Path]) -> str:
    width = max((len(verb) for verb in verbs), default=0)
    lines = [f"  {verb.ljust(width)}  {_caption(file)}" for verb, file in verbs.items()]
    usage = "usage: lodeline VERB ...\n       lodeline --help | --version"
    return "\n".join([usage, "", "verbs:", *lines, "", EPILOG.rstrip()])


def _caption(file: Path) -> str:
    """First line of a program's docstring, without running it."""
    return (ast.get_docstring(ast.parse(file.read_bytes())) or "").partition("\n")[0]


def _load(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"lodeline_tool_{file.stem}", file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _is_closed(stream: TextIO) -> bool:
    """Whether nobody reads a stream any more; then what is left for it goes nowhere, quietly."""
    ends = select.poll()
    ends.register(stream.fileno(), 0)  # errors are told unasked
    if not ends.poll(0):
        return False
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
    return True
