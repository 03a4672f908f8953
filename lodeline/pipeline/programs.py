"""The programs that a pipeline file names: found, imported and asked for ports and parameters."""

from __future__ import annotations

import contextlib
import inspect
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from lodeline.loading import load_node, shipped
from lodeline.node import Driver, Input, Node, Output
from lodeline.params import Problem, build, check_class, guess, shown
from lodeline.pipeline.document import Item, is_file
from lodeline.pipeline.draft import MAX_QUEUE, DraftNode
from lodeline.pipeline.faults import Fault, Place
from lodeline_msgs import Message


def find_program(run: str, folder: Path) -> Path | None:
    """The file that `run` names: beside the pipeline file, else among those that ship."""
    places = [folder / run]
    parts = Path(run).parts
    if parts[:1] == ("nodes",):
        places.append(shipped("nodes").joinpath(*parts[1:]))
    return next((place.resolve() for place in places if is_file(place)), None)


def load_program(
    node: DraftNode, folder: Path, faults: list[Fault]
) -> tuple[Path, type[Node[Any]]] | None:
    """File and node class of a node, or None and the reason among `faults`."""
    if not node.run:
        return None
    file = find_program(node.run, folder)
    if file is None:
        known = [f"nodes/{path.name}" for path in sorted(shipped("nodes").glob("*.py"))]
        beside = [*folder.glob("*.py"), *folder.glob("*/*.py")]
        known += [str(path.relative_to(folder)) for path in sorted(beside)]
        text = f"{node.run} is neither beside this file nor among the nodes that ship"
        faults.append(node.at("run").fault(f"{text} with Lodeline{guess(node.run, known)}"))
        return None
    try:
        # What a program prints while it is imported must not mix with our own output.
        with contextlib.redirect_stdout(sys.stderr):
            found = load_node(file)
        problems = _class_problems(found)
    except (Exception, SystemExit) as error:
        faults.append(node.at("run").fault(_import_failure(error, file, node.run)))
        return None
    faults.extend(node.at("run").fault(f"{node.run}: {text}") for text in problems)
    return None if problems else (file, found)


def _import_failure(error: BaseException, file: Path, run: str) -> str:
    line = None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = trace.tb_lineno
        trace = trace.tb_next
    if isinstance(error, SyntaxError) and error.filename == str(file):
        line = error.lineno
    text = (str(error).splitlines() or [""])[0]
    if line is None and isinstance(error, TypeError):
        return text  # load_node's own words
    where = f"{run}:{line}" if line else run
    return f"cannot be imported: {where}: {type(error).__name__}: {text}"


def _class_problems(cls: type[Node[Any]]) -> list[str]:
    """What keeps a node class from being run at all."""
    try:
        params = cls.params_type()
        check_class(params)
    except (TypeError, NameError) as error:
        return [str(error)]
    ports: list[Input[Any] | Output[Any]] = [*cls.inputs().values(), *cls.outputs().values()]
    problems = [
        f"port {port.name!r} of {cls.__name__} carries {shown(port.message)}, which is no message"
        " class"
        for port in ports
        if not (isinstance(port.message, type) and issubclass(port.message, Message))
    ]
    problems += [
        f"input port {port.name!r} of {cls.__name__}: {fault}"
        for port in cls.inputs().values()
        for fault in _policy_faults(port)
    ]
    problems += [
        f"input port {port.name!r} of {cls.__name__} has no handler"
        for port in cls.inputs().values()
        if not port.method
    ]
    problems += [
        f"handler of port {port.name!r} must take a sample: def {port.method}(self, sample)"
        for port in cls.inputs().values()
        if port.method and not _takes_one(getattr(cls, port.method))
    ]
    if issubclass(cls, Driver):
        if cls.tick is Driver.tick:
            problems.append(f"driver {cls.__name__} has no tick method")
        elif not _takes_one(cls.tick):
            problems.append(f"driver {cls.__name__} must take a stamp: def tick(self, stamp)")
        if "rate" not in {item.name for item in fields(params)}:
            problems.append(f"params of driver {cls.__name__} have no rate")
    elif not cls.inputs():
        problems.append(f"{cls.__name__} has no input port and is no Driver: it would never run")
    return problems


def _policy_faults(port: Input[Any]) -> Iterator[str]:
    if type(port.queue) is not int or not 1 <= port.queue <= MAX_QUEUE:
        yield f"queue must be a whole number from 1 to {MAX_QUEUE}, got {shown(port.queue)}"
    if port.max_age is not None and not (
        isinstance(port.max_age, int | float) and port.max_age > 0
    ):
        yield f"max_age must be positive, or None, got {shown(port.max_age)}"


def _takes_one(handler: Any) -> bool:
    """Whether a method can be called with itself and one thing more."""
    try:
        inspect.signature(handler).bind(None, None)
    except TypeError:
        return False
    return True


def build_params(node: DraftNode, cls: type[Node[Any]], faults: list[Fault]) -> Any:
    """The node's params, or None and what is wrong with them among `faults`."""
    item = node.items.get("params") or Item({}, node.place, node.place)
    if item.value is None:
        item = Item({}, item.place, item.key)
    if not isinstance(item.value, dict):
        text = f"params must be a mapping, got {shown(item.plain())}"
        faults.append(item.place.fault(text))
        return None
    params, problems = build(cls.params_type(), item.plain())
    rate = getattr(params, "rate", 1.0) if issubclass(cls, Driver) else 1.0
    if rate <= 0:
        blamed = ("rate",) if "rate" in item.value else ()
        problems.append(Problem(blamed, f"rate of a driver must be positive, got {rate:g}"))
    faults.extend(_place(item, problem).fault(problem.text) for problem in problems)
    return params


def _place(item: Item, problem: Problem) -> Place:
    """A wrong value is where it stands; a wrong name, or a group, where its key stands."""
    for step in problem.path:
        item = item.value[step]
    group = isinstance(item.value, dict)
    return item.key if problem.at_key or group else item.place
