"""Every way to break a pipeline file has its place and its words, and all are said at once.

A case replaces one piece of a good file; `«` stands where the fault must be found.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lodeline.pipeline.load import PipelineError, load

Write = Callable[[str], Path]
GOOD = (Path(__file__).parents[1] / "data/rig.yaml").read_text()

CASES: dict[str, tuple[str, str, str]] = {
    # the file as a whole
    "no name": (
        "name: rig\nclock",
        "«clock",
        "the pipeline has no name, write `name: ...`",
    ),
    "name with a capital": (
        "name: rig",
        "name: «Rig",
        "name 'Rig' must start with a-z and hold only a-z, 0-9, _, -",
    ),
    "name with a slash": (
        "name: rig",
        "name: «a/b",
        "name 'a/b' must start with a-z and hold only a-z, 0-9, _, -",
    ),
    "empty name": ("name: rig", "«name:", "name must be a text, got nothing"),
    "name that is a number": ("name: rig", "name: «7", "name must be a text, got 7"),
    "misspelt top key": (
        "clock: host",
        "«clok: host",
        "unknown key 'clok' in the file, did you mean 'clock'?",
    ),
    "top key of another world": (
        "clock: host",
        "«version: 3",
        "unknown key 'version' in the file "
        "(known: name, clock, hosts, tls, link_rate, external, nodes)",
    ),
    "unknown clock": (
        "clock: host",
        "clock: «hots",
        "clock must be one of host, recording, got the text \"hots\", did you mean 'host'?",
    ),
    # hosts
    "listen and connect": (
        "laptop: {connect: 10.0.0.1}",
        "«laptop: {connect: 10.0.0.1, listen: 10.0.0.2}",
        "host 'laptop' can listen or connect, not both",
    ),
    "host without an address": (
        "laptop: {connect: 10.0.0.1}",
        "«laptop:",
        "host 'laptop' has no address, write `listen: ...` or `connect: ...`",
    ),
    "nobody listens": (
        "hosts:\n  robot: {listen: 127.0.0.1}",
        "«hosts:\n  robot: {connect: 127.0.0.1}",
        "no host listens, so the hosts cannot reach each other",
    ),
    "address with a path": (
        "connect: 10.0.0.1",
        "connect: «http://10.0.0.1",
        "connect must be [tcp/|tls/]ADDRESS[:PORT], got 'http://10.0.0.1'",
    ),
    "address that is none": (
        "connect: 10.0.0.1",
        "connect: «10.0.0.256",
        "connect: '10.0.0.256' is neither an IP address nor the name of a machine",
    ),
    "port beyond 65535": (
        "connect: 10.0.0.1",
        "connect: «10.0.0.1:70000",
        "connect must be [tcp/|tls/]ADDRESS[:PORT], got '10.0.0.1:70000'",
    ),
    "misspelt host option": (
        "laptop: {connect: 10.0.0.1}",
        "laptop: {«conect: 10.0.0.1}",
        "unknown key 'conect' in host 'laptop', did you mean 'connect'?",
    ),
    "unknown host": (
        "host: laptop",
        "host: «labtop",
        "unknown host 'labtop', did you mean 'laptop'? (hosts: robot, laptop)",
    ),
    # external
    "unknown message class": (
        "cmd_vel: Twist",
        "cmd_vel: «Twits",
        "unknown message class 'Twits', did you mean 'Twist'?",
    ),
    "external key that a node sends": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels, reeds: «cmd_vel}",
        "key 'cmd_vel' is external, so node 'source' cannot send it",
    ),
    # nodes
    "misspelt node key": (
        "    outputs: {wheels",
        "    «ouputs: {wheels",
        "unknown key 'ouputs' in node 'source', did you mean 'outputs'?",
    ),
    "node name with a dash": (
        "  watcher:",
        "  «my-watcher:",
        "node 'my-watcher' must start with a-z and hold only a-z, 0-9, _",
    ),
    "no run": (
        "  source:\n    run: nodes/source.py",
        "  «source:",
        "node 'source' names no program, write `run: nodes/....py`",
    ),
    "run that is not there": (
        "run: nodes/source.py",
        "run: «nodes/sourse.py",
        "nodes/sourse.py is neither beside this file nor among the nodes that ship with Lodeline,"
        " did you mean 'nodes/source.py'?",
    ),
    "run that is a list": (
        "run: nodes/source.py",
        "run: «[nodes/source.py]",
        "run must be a text, got a list of 1",
    ),
    "run that is no Python": (
        "run: nodes/source.py",
        "run: «pipeline.yaml",
        "{folder}/pipeline.yaml is no Python file",
    ),
    "unknown restart": (
        "restart: always",
        "restart: «alwys",
        'restart must be one of always, limited, never, got the text "alwys",'
        " did you mean 'always'?",
    ),
    "required by an old word": (
        "required: false",
        "required: «yes",
        'required must be true or false, got the text "yes"',
    ),
    "priority beyond 99": (
        "priority: 20",
        "priority: «100",
        "priority must be from 1 to 99, got 100",
    ),
    "priority that is true": (
        "priority: 20",
        "priority: «true",
        "priority must be a whole number, got true",
    ),
    "negative cpu": ("cpu: 1", "cpu: «-1", "cpu must be from 0 to 1023, got -1"),
    # ports and keys
    "unknown input port": (
        "inputs: {wheels: wheels}",
        "inputs: {«wheel: wheels, back: cmd_vel}",
        "Smoother has no input port 'wheel', did you mean 'wheels'?",
    ),
    "input that is an output": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: wheels, «speed: cmd_vel}",
        "Smoother has no input port 'speed', it is an output port",
    ),
    "output of a node that has none": (
        "params: {limit: 3}",
        "params: {limit: 3}\n    outputs: {«speed: other}",
        "Watcher has no output port 'speed', it is an input port",
    ),
    "unknown output port": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels, «red: reeds}",
        "Source has no output port 'red', did you mean 'reeds'?",
    ),
    "nobody sends it": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: «weels}",
        "nobody sends 'weels', did you mean 'wheels'?",
    ),
    "key with the pipeline's name": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: «rig/wheels}",
        "nobody sends 'rig/wheels', keys stand here without 'rig/'",
    ),
    "key with a space": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: wheels, back: cmd_vel}\n    outputs: {speed: «a b}\n  spare:\n"
        "    run: nodes/smoother.py\n    inputs: {wheels: wheels}",
        "key 'a b' may hold a-z, 0-9 and _, in parts separated by /",
    ),
    "wildcard key": (
        "  cmd_vel: Twist",
        "  cmd_vel: Twist\n  «imu/*: Imu",
        "key 'imu/*' may hold a-z, 0-9 and _, in parts separated by /",
    ),
    "reserved key": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels, reeds: «status/source}",
        "key 'status/source' is reserved: nodes send their health there",
    ),
    "two sources": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels}\n  second:\n    run: nodes/source.py\n"
        "    outputs: {wheels: «wheels}",
        "key 'wheels' has two sources: nodes 'source' and 'second'",
    ),
    "two ports to one key": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels, reeds: «wheels}",
        "key 'wheels' has two sources: two ports of node 'source'",
    ),
    "types that differ": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: wheels, back: «wheels}",
        "key 'wheels' carries WheelTicks (node 'source'), but input 'back' of Smoother takes Twist",
    ),
    "external type that differs": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: «cmd_vel}",
        "key 'cmd_vel' carries Twist (external), but input 'wheels' of Smoother takes WheelTicks",
    ),
    "no input wired": (
        "  smoother:\n    run: nodes/smoother.py\n    process: core\n    inputs: {wheels: wheels}",
        "  «smoother:\n    run: nodes/smoother.py\n    process: core",
        "no input port of node 'smoother' is wired (it has: wheels, back)",
    ),
    "input without a key": (
        "{key: speed/mean, queue: 32, max_age: 0.25}",
        "«{queue: 32}",
        "input 'speed' names no key, write `key: ...`",
    ),
    "misspelt option of an input": (
        "max_age: 0.25",
        "«maxage: 0.25",
        "unknown key 'maxage' in input 'speed', did you mean 'max_age'?",
    ),
    "queue of none": (
        "queue: 32",
        "queue: «0",
        "queue must be latest or a whole number from 1 to 100000, got 0",
    ),
    "queue by another word": (
        "queue: 32",
        "queue: «newest",
        'queue must be latest or a whole number from 1 to 100000, got the text "newest"',
    ),
    "no age at all": ("max_age: 0.25", "max_age: «0", "max_age must be positive, got 0"),
    "age in words": (
        "max_age: 0.25",
        "max_age: «250ms",
        'max_age must be a number [s], got the text "250ms"',
    ),
    "output with options": (
        "outputs: {wheels: wheels}",
        "outputs: {wheels: wheels, reeds: «{key: reeds}}",
        "key of output 'reeds' must be a text, got a mapping",
    ),
    "rate of an unwired port": (
        "rate: {speed: 100}",
        "rate: {«sped: 100}",
        "rate of 'sped', which is no wired output port, did you mean 'speed'?",
    ),
    "rate of zero": (
        "rate: {speed: 100}",
        "rate: {speed: «0}",
        "rate of 'speed' must be positive, got 0",
    ),
    "cycle of two": (
        "restart: always\n",
        "restart: always\n"
        "  first: {run: nodes/smoother.py, inputs: {back: «two}, outputs: {speed: one}}\n"
        "  second: {run: nodes/smoother.py, inputs: {back: one}, outputs: {speed: two}}\n",
        "cycle: first -> second -> first",
    ),
    "cycle of three": (
        "restart: always\n",
        "restart: always\n"
        "  b: {run: nodes/smoother.py, inputs: {back: «c}, outputs: {speed: b}}\n"
        "  c: {run: nodes/smoother.py, inputs: {back: a}, outputs: {speed: c}}\n"
        "  a: {run: nodes/smoother.py, inputs: {back: b}, outputs: {speed: a}}\n",
        "cycle: b -> a -> c -> b",
    ),
    "cycle of one": (
        "inputs: {wheels: wheels}",
        "inputs: {wheels: wheels, back: «speed/mean}",
        "cycle: smoother -> smoother",
    ),
    "process over two hosts": (
        "restart: always\n",
        "restart: always\n  spare:\n    run: nodes/source.py\n    host: laptop\n"
        "    process: «core\n",
        "nodes 'smoother' and 'spare' share process 'core', but run on hosts 'robot' and 'laptop'",
    ),
    "process of two priorities": (
        "params: {seed: 7}",
        "params: {seed: 7}\n    priority: «30",
        "nodes 'smoother' and 'source' share process 'core', but 'smoother' has priority: 20",
    ),
    # parameters
    "misspelt parameter": (
        "window: 0.2",
        "«widow: 0.2",
        "unknown parameter 'widow', did you mean 'window'?",
    ),
    "quoted number": (
        "window: 0.2",
        'window: «"0.2"',
        'window must be a number [s], got the text "0.2", write it without quotes',
    ),
    "number that is not finite": (
        "window: 0.2",
        "window: «.nan",
        "window must be a number [s], got nan",
    ),
    "number that is true": (
        "window: 0.2",
        "window: «true",
        "window must be a number [s], got true",
    ),
    "out of range": ("window: 0.2", "window: «-0.2", "window must be positive, got -0.2"),
    "whole number with a point": (
        "seed: 7",
        "seed: «7.5",
        "seed must be a whole number, got 7.5",
    ),
    "one of two types": (
        "seed: 7",
        "bus: «1.5",
        "bus must be a whole number or a text [number of the bus, or sim], got 1.5",
    ),
    "word that is none of them": (
        "seed: 7",
        "speed: «fats",
        "speed must be one of slow, fast, got the text \"fats\", did you mean 'fast'?",
    ),
    "list too short": (
        "window: 0.2",
        "weights: «[0.5, 0.5]",
        "weights must be a list of 3, got a list of 2",
    ),
    "text in a list": (
        "window: 0.2",
        "weights: [0.5, «half, 0.25]",
        'weights[1] must be a number, got the text "half"',
    ),
    "text in a list of any length": (
        "window: 0.2",
        "taps: [1, 2, «3.5]",
        "taps[2] must be a whole number, got 3.5",
    ),
    "parameter within a group": (
        "{low: 1e-3}",
        "{low: 1e-3, «gain: 1}",
        "unknown parameter 'gain' (known: low, high)",
    ),
    "group out of range": (
        "limits: {low: 1e-3}",
        "«limits: {low: 2, high: 1}",
        "the limits are the wrong way round",
    ),
    "group that is a number": (
        "limits: {low: 1e-3}",
        "limits: «3",
        "limits must be a mapping of parameters, got 3",
    ),
    "missing parameter": (
        "params: {limit: 3}",
        "«params: {}",
        "parameter 'limit' is missing",
    ),
    "missing params": (
        "  source:",
        "  «spare: {run: nodes/watcher.py, inputs: {speed: speed/mean}}\n  source:",
        "parameter 'limit' is missing",
    ),
    "params as a list": (
        "params: {limit: 3}",
        "params: «[limit, 3]",
        "params must be a mapping, got a list of 2",
    ),
    "driver at rest": ("seed: 7", "rate: «0", "rate of a driver must be positive, got 0"),
    # YAML
    "key that stands twice": (
        "clock: host",
        "clock: host\n«clock: recording",
        "'clock' stands twice, first in line 2",
    ),
    "node that stands twice": (
        "  source:",
        "  source: {run: nodes/source.py, outputs: {wheels: wheels}}\n  «source:",
        "'source' stands twice, first in line 24",
    ),
    "tab": ("  robot: {", "«\trobot: {", "a tab cannot indent, write spaces"),
    "anchor": ("window: 0.2", "window: «&w 0.2", "anchors (&) are not read, write the value out"),
    "alias": ("window: 0.2", "window: «*w", "aliases (*) are not read, write the value out"),
    "merge key": (
        "window: 0.2",
        "«<<: {window: 0.2}",
        "merge keys (<<) are not read, write the values out",
    ),
    "tag": ("seed: 7", "seed: «!!python/name:os.system 7", "tags (!) are not read"),
    "second document": (
        "external:",
        "«---\nexternal:",
        "a second document starts here, one is read",
    ),
    "other YAML": ("name: rig", "%YAML 1.1\n«---\nname: rig", "only YAML 1.2 is read"),
    "key that is a list": ("seed: 7", "«[a]: 7", "a key must be a word"),
    "number beyond 64 bits": (
        "seed: 7",
        "seed: «99999999999999999999",
        "is a whole number beyond 64 bits",
    ),
    "two colons": (
        "clock: host",
        "clock: host«: now",
        "no YAML: mapping values are not allowed here",
    ),
    "control character": ("clock: host", "clock: h«\x07st", "character U+0007 is not allowed"),
}


@pytest.mark.parametrize("case", CASES)
def test_fault_has_its_place_and_its_words(case: str, write: Write) -> None:
    old, new, message = CASES[case]
    assert GOOD.count(old) == 1, "the case must be clear about what it replaces"
    text = GOOD.replace(old, new)
    before, _, after = text.partition("«")
    file = write(before + after)
    line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
    with pytest.raises(PipelineError) as caught:
        load(file)
    message = message.replace("{folder}", str(file.parent))
    assert str(caught.value) == f"{file}:{line}:{column}: {message}"


def test_the_file_that_the_cases_break_is_fine(write: Write) -> None:
    assert load(write(GOOD)).warnings == ()


WHOLE: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "{file}: is empty"),
    "comments only": (b"# name: rig\n", "{file}: is empty"),
    "a list": (b"- name: rig\n", "{file}:1:1: a pipeline file is a mapping, got a list of 1"),
    "a word": (b"rig\n", '{file}:1:1: a pipeline file is a mapping, got the text "rig"'),
    "no nodes": (b"name: rig\n", "{file}:1:1: the pipeline has no nodes"),
    "nodes of nothing": (b"name: rig\nnodes: {}\n", "{file}:2:1: the pipeline has no nodes"),
    "nodes as a list": (
        b"name: rig\nnodes: [a]\n",
        "{file}:2:8: nodes must be a mapping, got a list of 1",
    ),
    "not UTF-8": (b"name: rig\nclock: \xe9t\xe9\n", "{file}:2:8: byte 0xe9 is not UTF-8"),
    "UTF-16": ("name: rig".encode("utf-16"), "{file}:1:1: byte 0xff is not UTF-8"),
}


@pytest.mark.parametrize("case", WHOLE)
def test_file_without_a_pipeline_in_it(case: str, folder: Path) -> None:
    data, message = WHOLE[case]
    file = folder / "pipeline.yaml"
    file.write_bytes(data)
    with pytest.raises(PipelineError) as caught:
        load(file)
    assert str(caught.value) == message.replace("{file}", str(file))


def test_file_that_is_not_there(folder: Path) -> None:
    with pytest.raises(PipelineError, match=r"none\.yaml: there is no such file"):
        load(folder / "none.yaml")


def test_all_faults_are_said_in_one_run_in_the_order_of_the_file(write: Write) -> None:
    independent = (
        "unknown clock",
        "host without an address",
        "unknown message class",
        "queue of none",
        "missing parameter",
        "required by an old word",
        "misspelt parameter",
        "group out of range",
        "rate of zero",
        "priority beyond 99",
        "negative cpu",
        "unknown output port",
        "whole number with a point",
        "unknown restart",
    )
    text = GOOD
    for case in independent:
        old, new, _ = CASES[case]
        text = text.replace(old, new)
    marks = text.count("«")
    places = []
    while "«" in text:
        before, _, after = text.partition("«")
        places.append((before.count("\n") + 1, len(before) - before.rfind("\n")))
        text = before + after
    file = write(text)
    with pytest.raises(PipelineError) as caught:
        load(file)
    assert marks == len(independent)
    assert [(fault.line, fault.column) for fault in caught.value.faults] == places
    assert [fault.text for fault in caught.value.faults] == [CASES[each][2] for each in independent]
