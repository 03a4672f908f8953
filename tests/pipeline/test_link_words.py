"""What a pipeline file says of the link between its hosts, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lodeline.hosts.links import endpoint, link_of
from lodeline.pipeline.load import PipelineError, load

Write = Callable[[str], Path]
GOOD = (Path(__file__).parents[1] / "data/rig.yaml").read_text()


def test_keys_lie_beside_the_file_and_make_every_link_tls(write: Write, folder: Path) -> None:
    text = GOOD.replace("listen: 127.0.0.1", "listen: 10.0.0.1") + "tls: keys\n"
    pipeline = load(write(text))
    assert pipeline.tls == folder.resolve() / "keys"
    assert pipeline.warnings == ()
    assert link_of(pipeline, "robot").listen == ("tls/10.0.0.1:7447#so_sndbuf=8192",)
    assert link_of(pipeline, "laptop").connect == ("tls/10.0.0.1:7447#so_sndbuf=8192",)


def test_a_host_may_send_its_own_keys_and_its_grants_only(write: Write) -> None:
    text = GOOD.replace("connect: 10.0.0.1", "connect: 10.0.0.1, grant: [cmd_vel]") + "tls: keys\n"
    rules = link_of(load(write(text)), "robot").settings["access_control"]["rules"]
    (sends,) = [rule["key_exprs"] for rule in rules if rule["id"] == "send-laptop"]
    assert "rig/cmd_vel" in sends
    assert "rig/status/watcher" in sends
    assert not {"rig/wheels", "rig/speed/mean", "rig/status/source", "rig/**"} & set(sends)


def test_orders_to_nodes_of_another_host_are_granted_over_tls_and_free_without(
    write: Write,
) -> None:
    assert link_of(load(write(GOOD)), "laptop").withheld == ()
    secured = GOOD + "tls: keys\n"
    assert link_of(load(write(secured)), "laptop").withheld == (
        *("@restart", "@calibrate"),
        "cmd_vel",
    )
    text = secured.replace("connect: 10.0.0.1", "connect: 10.0.0.1, grant: [restart]")
    assert link_of(load(write(text)), "laptop").withheld == ("@calibrate", "cmd_vel")
    policies = link_of(load(write(text)), "robot").settings["access_control"]
    (obeyed,) = [rule for rule in policies["rules"] if rule["id"] == "obey-laptop"]
    assert (obeyed["messages"], obeyed["key_exprs"]) == (["query"], ["rig/@restart/**"])
    # A key of that name is just a key.
    text = text.replace("external:\n", "external:\n  restart: Twist\n")
    assert "@restart" in link_of(load(write(text)), "laptop").withheld


def test_hosts_that_meet_at_a_router_are_told_that_it_must_listen(write: Write) -> None:
    text = GOOD.replace("listen: 127.0.0.1", "connect: 10.0.0.9").replace("10.0.0.1", "10.0.0.9")
    (warning,) = load(write(text)).warnings
    assert "no host listens, so a zenoh router must, at 10.0.0.9" in warning


def test_link_rate_is_for_the_link_alone(write: Write) -> None:
    pipeline = load(write(GOOD + "link_rate: {wheels: 20}\n"))
    assert pipeline.link_rate == {"rig/wheels": 20.0}
    (rule,) = link_of(pipeline, "robot").settings["downsampling"]
    assert rule["link_protocols"] == ["tcp", "tls"]
    assert rule["rules"] == [{"key_expr": "rig/wheels", "freq": 20.0}]


@pytest.mark.parametrize(
    ("address", "end"),
    [
        ("10.0.0.1", "tcp/10.0.0.1:7447"),
        ("tls/robot.local:7000", "tls/robot.local:7000"),
        ("[fe80::1]", "tcp/[fe80::1]:7447"),
    ],
)
def test_an_address_gets_what_it_lacks(address: str, end: str) -> None:
    assert endpoint(address) == f"{end}#so_sndbuf=8192"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("clock: host", "link_rate: {wheel: 20}", "link_rate of 'wheel', which no node sends"),
        ("clock: host", "link_rate: {wheels: 0}", "rate of 'wheels' must be positive, got 0"),
        (
            "connect: 10.0.0.1",
            "connect: 10.0.0.1, grant: [wheels]",
            "host 'laptop' is granted 'wheels', which is no external key",
        ),
        (
            "clock: host\nhosts:\n  robot: {listen: 127.0.0.1}",
            "tls: keys\nhosts:\n  robot: {listen: tcp/127.0.0.1}",
            "listen is plain tcp, but the file has tls: leave out `tcp/`",
        ),
    ],
)
def test_a_wrong_word_on_the_link_is_named(write: Write, old: str, new: str, message: str) -> None:
    with pytest.raises(PipelineError, match=message.replace("[", r"\[")):
        load(write(GOOD.replace(old, new)))
