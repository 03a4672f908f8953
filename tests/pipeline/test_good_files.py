"""What a good file becomes: nodes in the order of data flow, full keys, defaults, a digest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lodeline.launch import Launch, launch_of
from lodeline.loading import shipped
from lodeline.pipeline.edge import Edge
from lodeline.pipeline.load import PipelineError, find, load
from lodeline.pipeline.model import Host
from lodeline_msgs import Twist, WheelTicks

Write = Callable[[str], Path]
GOOD = (Path(__file__).parents[1] / "data/rig.yaml").read_text()


def test_model_says_what_the_file_says(write: Write, folder: Path) -> None:
    file = write(GOOD)
    pipeline = load(file)
    assert (pipeline.name, pipeline.file, pipeline.clock) == ("rig", file.resolve(), "host")
    assert pipeline.hosts == {
        "robot": Host("robot", listen="127.0.0.1"),
        "laptop": Host("laptop", connect="10.0.0.1"),
    }
    assert pipeline.external == {"rig/cmd_vel": Twist}
    assert pipeline.key_types() == {
        "rig/cmd_vel": Twist,
        "rig/wheels": WheelTicks,
        "rig/speed/mean": Twist,
    }
    source, smoother, watcher = pipeline.nodes
    assert source.is_driver and source.restart == "always" and source.params.seed == 7
    assert source.run == (folder / "nodes/source.py").resolve()
    assert smoother.inputs == {"wheels": Edge("rig/wheels", 8, 0.5)}  # as the program says
    assert watcher.inputs == {"speed": Edge("rig/speed/mean", 32, 0.25)}  # as the file says
    assert smoother.outputs == {"speed": "rig/speed/mean"} and smoother.rates == {"speed": 100.0}
    assert (smoother.params.window, smoother.params.limits.low) == (0.2, 0.001)
    assert (smoother.priority, smoother.cpu, smoother.restart) == (20, 1, "limited")
    assert (watcher.host, watcher.process, watcher.required) == ("laptop", "watcher", False)
    assert {name: len(specs) for name, specs in pipeline.processes("robot").items()} == {"core": 2}


def test_nodes_stand_in_the_order_of_data_flow_and_else_of_the_file(write: Write) -> None:
    node = "  {}: {{run: nodes/smoother.py, inputs: {{{}}}, outputs: {{speed: {}}}}}\n"
    text = "name: rig\nnodes:\n"
    text += node.format("last", "back: c", "d")
    text += node.format("third", "back: b", "c")
    text += node.format("also_second", "back: a", "x")
    text += node.format("second", "back: a", "b")
    text += node.format("first", "wheels: wheels", "a")
    text += "  late: {run: nodes/source.py, inputs: {cmd_vel: d}, outputs: {wheels: wheels}}\n"
    text += "  other: {run: nodes/source.py}\n"
    order = [spec.name for spec in load(write(text)).nodes]
    assert order == ["late", "other", "first", "also_second", "second", "third", "last"]


def test_a_loop_through_a_driver_is_no_cycle(write: Write) -> None:
    text = GOOD.replace("cmd_vel: cmd_vel", "cmd_vel: speed/mean")
    assert [spec.name for spec in load(write(text)).nodes] == ["source", "smoother", "watcher"]


def test_short_file_gets_the_defaults(write: Write) -> None:
    pipeline = load(write("name: rig\nexternal:\nnodes:\n  source:\n    run: nodes/source.py\n"))
    (source,) = pipeline.nodes
    assert pipeline.hosts == {"robot": Host("robot")}
    assert (source.host, source.process, source.restart) == ("robot", "source", "always")
    assert (source.inputs, source.outputs, source.rates) == ({}, {}, {})
    assert (source.required, source.priority, source.cpu) == (False, None, None)


@pytest.mark.parametrize(
    ("said", "edge"),
    [
        ("wheels", Edge("rig/wheels", 8, 0.5)),
        ("{key: wheels}", Edge("rig/wheels", 8, 0.5)),
        ("{key: wheels, queue: latest}", Edge("rig/wheels", 1, 0.5)),
        ("{key: wheels, queue: 100}", Edge("rig/wheels", 100, 0.5)),
        ("{key: wheels, max_age: 2}", Edge("rig/wheels", 8, 2.0)),
        ("{key: wheels, max_age: null}", Edge("rig/wheels", 8, None)),
    ],
)
def test_queue_and_age_of_an_edge(said: str, edge: Edge, write: Write) -> None:
    file = write(GOOD.replace("inputs: {wheels: wheels}", f"inputs: {{wheels: {said}}}"))
    assert load(file).node("smoother").inputs["wheels"] == edge


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-3", 0.001),
        ("1.0e-1", 0.1),
        ("1E3", 1000.0),
        (".5", 0.5),
        ("+2", 2.0),
        ("010", 10.0),
        ("0x10", 16.0),
    ],
)
def test_numbers_mean_what_yaml_1_2_says(written: str, value: float, write: Write) -> None:
    file = write(GOOD.replace("window: 0.2", f"window: {written}"))
    assert load(file).node("smoother").params.window == value


@pytest.mark.parametrize("word", ["no", "on", "yes", "1:30", "2024-01-01", "1_000", "n", "0o8"])
def test_words_that_older_yaml_takes_for_something_else_are_text(word: str, write: Write) -> None:
    file = write(GOOD.replace("window: 0.2", f"label: {word}"))
    assert load(file).node("smoother").params.label == word


def test_both_forms_of_a_param_of_two_types(write: Write) -> None:
    assert load(write(GOOD.replace("seed: 7", "bus: 1"))).node("source").params.bus == 1
    assert load(write(GOOD.replace("seed: 7", "bus: sim"))).node("source").params.bus == "sim"


def test_digest_knows_what_is_computed_from_how_it_is_written(write: Write) -> None:
    digest = load(write(GOOD)).digest
    assert len(digest) == 12 and int(digest, 16) >= 0
    same = (
        ("clock: host", "# said twice\n"),  # a default left out, a comment
        ("priority: 20", "priority: 21"),
        ("inputs: {wheels: wheels}", "inputs:\n      wheels: {key: wheels, queue: 8}"),
        ("window: 0.2", "window: 2e-1"),
        ("connect: 10.0.0.1", "connect: 10.0.0.2"),
    )
    other = (
        ("name: rig", "name: rag"),
        ("clock: host", "clock: recording"),
        ("window: 0.2", "window: 0.3"),
        ("queue: 32", "queue: 33"),
        ("host: laptop", "host: robot"),
        ("low: 1e-3", "low: 2e-3"),
    )
    for old, new in same:
        assert load(write(GOOD.replace(old, new))).digest == digest, new
    for old, new in other:
        assert load(write(GOOD.replace(old, new))).digest != digest, new


def test_digest_changes_with_the_text_of_a_program(folder: Path) -> None:
    digests = set()
    for place, text in (("a", ""), ("b", "# changed\n")):
        (folder / place).mkdir()
        program = (folder / "nodes/source.py").read_text() + text
        (folder / place / "own.py").write_text(program)
        file = folder / place / "pipeline.yaml"
        file.write_text("name: rig\nnodes: {own: {run: own.py}}\n")
        digests.add(load(file).digest)
    assert len(digests) == 2


def test_overrides_win_and_are_checked_like_the_file(write: Write) -> None:
    overrides = [
        "smoother.window=1e-1",
        "smoother.weights=[0, 1, 0]",
        "smoother.limits.high=2",
        "source.bus=3",
        "source.speed=fast",
        "source.seed=8",
        "source.seed=9",
        "smoother.label=",
    ]
    pipeline = load(write(GOOD), overrides)
    smoother, source = pipeline.node("smoother").params, pipeline.node("source").params
    assert (smoother.window, smoother.weights, smoother.label) == (0.1, (0.0, 1.0, 0.0), None)
    assert (smoother.limits.low, smoother.limits.high) == (0.001, 2.0)
    assert (source.bus, source.speed, source.seed) == (3, "fast", 9)
    assert pipeline.digest != load(write(GOOD)).digest


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("smoother", "must be NODE.PARAM=VALUE"),
        ("smoother=3", "must be NODE.PARAM=VALUE"),
        ("smoother.=3", "must be NODE.PARAM=VALUE"),
        ("smother.window=3", "unknown node 'smother', did you mean 'smoother'?"),
        ("smoother.widow=3", "unknown parameter 'widow', did you mean 'window'?"),
        ("smoother.window=abc", 'window must be a number [s], got the text "abc"'),
        ("smoother.window=-1", "window must be positive, got -1"),
        ("smoother.window=[1", "no YAML: while parsing a flow sequence, expected ',' or ']',"
         " but got '<stream end>'"),
        ("smoother.window=*a", "aliases (*) are not read, write the value out"),
        ("smoother.window.low=1", "window is a single value in the file"),
        ("smoother.limits.lw=1", "unknown parameter 'lw', did you mean 'low'?"),
        ("watcher.limit=1.5", "limit must be a whole number, got 1.5"),
        ("watcher.limit=", "limit must be a whole number, got nothing"),
    ],
)  # fmt: skip
def test_wrong_override_is_named_by_itself(override: str, message: str, write: Write) -> None:
    with pytest.raises(PipelineError) as caught:
        load(write(GOOD), [override])
    assert str(caught.value) == f"--set {override}: {message}"


def test_override_may_give_what_the_file_lacks(write: Write) -> None:
    file = write(GOOD.replace("    params: {limit: 3}\n", ""))
    assert load(file, ["watcher.limit=4"]).node("watcher").params.limit == 4


@pytest.mark.parametrize(
    ("address", "warned"),
    [
        ("127.0.0.1", False),
        ("localhost:7447", False),
        ("'[::1]:7447'", False),
        ("tls/192.168.7.1:7447", False),
        ("192.168.7.1", True),
        ("tcp/0.0.0.0:7447", True),
        ("'[fe80::1]'", True),
    ],
)
def test_open_door_is_worth_a_warning(address: str, warned: bool, write: Write) -> None:
    file = write(GOOD.replace("listen: 127.0.0.1", f"listen: {address}"))
    said = address.strip("'")
    text = f"{file}:4:19: host 'robot' listens on {said} without tls:"
    expected = (f"{text} anyone on that network can read and send",) if warned else ()
    assert load(file).warnings == expected


def test_launch_of_a_loaded_pipeline_survives_the_way_to_its_process(write: Write) -> None:
    pipeline = load(write(GOOD))
    launch = launch_of(pipeline, "robot", "core", Path("/run/rig"), epoch_offset=1)
    assert Launch.from_json(launch.to_json()).nodes[1].inputs == launch.nodes[1].inputs


def test_shipped_files_are_fine() -> None:
    files = [shipped("pipeline.yaml"), *sorted(shipped("profiles").glob("*.yaml"))]
    assert len(files) >= 2
    for file in files:
        assert load(file).nodes, file


def test_find_takes_a_path_a_profile_or_the_file_at_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find(None) == shipped("pipeline.yaml")
    assert find("magnet-lab") == shipped("profiles") / "magnet_lab.yaml"
    Path("pipeline.yaml").touch()
    Path("magnet-lab").touch()
    assert find(None) == Path("pipeline.yaml")
    assert find("magnet-lab") == Path("magnet-lab")
    assert find(str(tmp_path / "pipeline.yaml")) == tmp_path / "pipeline.yaml"


@pytest.mark.parametrize("name", ["magnt-lab", "magnet_lab"])
def test_find_names_the_nearest_profile(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PipelineError) as caught:
        find(name)
    text = "is neither a file nor a profile, did you mean 'magnet-lab'?"
    assert str(caught.value) == f"{name}: {text}"


@pytest.mark.parametrize("name", ["x" * 5000, "no/such/place", "/"])
def test_find_refuses_odd_names_in_words(name: str) -> None:
    with pytest.raises(PipelineError, match="is neither a file nor a profile"):
        find(name)


def test_a_folder_is_no_pipeline_but_may_hold_one(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.yaml"
    file.touch()
    with pytest.raises(PipelineError, match=f"is a folder, did you mean {file}\\?"):
        find(str(tmp_path))
