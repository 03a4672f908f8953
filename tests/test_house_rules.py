"""Who may import whom, read off the source: the floors of the house stay apart."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ALGORITHMS = (
    "attitude",
    "calibration",
    "dead_reckoning",
    "ekf",
    "magnets",
    "odometry",
    "rotation",
    "stamps",
)
DEVICES = ("devices", "i2c", "sim")
CLOCKS = {"time", "datetime"}
OUTSIDE = {"os", "io", "socket", "subprocess", "pathlib", "threading", "asyncio"}
PLUMBING = {
    f"lodeline.{name}"
    for name in (
        "bus",
        "clock",
        "graph",
        "inlet",
        "launch",
        "node",
        "pipeline",
        "process",
        "sessions",
        "status",
    )
}


def sources(*places: str) -> list[Path]:
    """Python files below the given places of the project."""
    files: list[Path] = []
    for place in places:
        path = ROOT / place
        files += sorted(path.rglob("*.py")) if path.is_dir() else [path.with_suffix(".py")]
    return files


def imports(file: Path) -> Iterator[str]:
    """Dotted names of all modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} imports relatively"
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def offenders(files: list[Path], forbidden: set[str]) -> list[str]:
    """Imports of a forbidden module or of something below it."""
    return [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in files
        for name in imports(file)
        if any(name == taboo or name.startswith(f"{taboo}.") for taboo in forbidden)
    ]


def algorithm_files() -> list[Path]:
    return sources(*(f"lodeline/{name}" for name in ALGORITHMS))


def test_one_file_of_the_library_imports_zenoh() -> None:
    """Besides the baselines of the bench, which measure zenoh without us."""
    baselines = sources("lodeline/bench/chain/raw", "lodeline/bench/chain/calls")
    files = [
        file for file in sources("lodeline", "nodes", "tools", "proto") if file not in baselines
    ]
    users = {
        file.relative_to(ROOT).as_posix()
        for file in files
        if any(name.split(".")[0] == "zenoh" for name in imports(file))
    }
    assert users == {"lodeline/bus.py"}


def test_messages_import_nothing_of_the_library() -> None:
    assert offenders(sources("proto"), {"lodeline"}) == []


def test_algorithms_know_neither_messages_nor_bus_nor_clock_nor_files() -> None:
    forbidden = {"lodeline_msgs", "lodeline.devices", "lodeline.sim"} | PLUMBING | CLOCKS | OUTSIDE
    assert offenders(algorithm_files(), forbidden) == []
    allowed = tuple(f"lodeline.{name}" for name in (*ALGORITHMS, "params"))
    others = [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in algorithm_files()
        for name in imports(file)
        if name.startswith("lodeline") and not name.startswith(allowed)
    ]
    assert others == []


def test_devices_know_neither_messages_nor_bus_nor_nodes() -> None:
    files = sources(*(f"lodeline/{name}" for name in DEVICES))
    assert offenders(files, {"lodeline_msgs"} | PLUMBING) == []


def test_device_drivers_and_models_have_no_clock() -> None:
    files = [*sources("lodeline/devices"), *sources("lodeline/sim/chips")]
    assert offenders(files, CLOCKS) == []


def test_the_library_imports_neither_nodes_nor_tools() -> None:
    assert offenders(sources("lodeline"), {"nodes", "tools"}) == []


def test_nodes_import_no_zenoh_and_no_other_node() -> None:
    others = {file.stem for file in sources("nodes")}
    forbidden = others | {"nodes", "zenoh", "lodeline.bus", "lodeline.clock"} | CLOCKS
    assert offenders(sources("nodes"), forbidden) == []


@pytest.mark.parametrize("file", sources("nodes"), ids=lambda file: file.stem)
def test_nodes_hold_no_arithmetic(file: Path) -> None:
    sums = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.MatMult)
    found = [
        f"{file.name}:{node.lineno}"
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, sums)
    ]
    assert found == []


def test_importing_a_node_loads_no_array_library() -> None:
    heavy = {"numpy", "scipy", "filterpy"}
    for file in [*sources("nodes"), *sources("lodeline")]:
        tree = ast.parse(file.read_text())
        top = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
        names = {
            name.partition(".")[0]
            for node in top
            for name in (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else [node.module or ""]
            )
        }
        # a class may use matrices: its exercises start nowhere but on its own machines
        exempt = file.name == "filterpy_engine.py" or file.parent.name == "exercises"
        allowed = heavy if exempt else set()
        assert not (names & heavy) - allowed, file


def test_no_package_marker_where_programs_are_run_by_path() -> None:
    for folder in ("nodes", "tools", "proto"):
        assert not (ROOT / folder / "__init__.py").exists()


@pytest.mark.parametrize("file", sources("lodeline", "nodes", "tools", "proto"), ids=str)
def test_every_module_opens_with_a_caption(file: Path) -> None:
    assert ast.get_docstring(ast.parse(file.read_text())), file
