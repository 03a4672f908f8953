"""Who may say what over the link: an access-control list derived from the pipeline.

A host may send the keys of its own nodes, and what tools on it were granted (`grant:`); it may
read everything of the pipeline. Orders to nodes of another host (`restart`, `calibrate`) are
granted as keys are. Whoever is not named in the pipeline may do nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from lodeline.recent import recent_key

if TYPE_CHECKING:  # every node imports the bus, and the bus this
    from lodeline.pipeline.model import Pipeline

CONTROL = ("@claim", "@share", "@clock", "@ps", "@log")
"""What every supervisor says under its own host's name."""
ORDERS = ("restart", "calibrate")
"""What `grant` may name beside keys: tools may tell nodes of other hosts to do that."""
_READ = ["declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"]
_SEND = ["put", "delete", "reply", "declare_queryable", "liveliness_token"]


def sends(pipeline: Pipeline, host: str) -> list[str]:
    """Key expressions that a host may send."""
    name = pipeline.name
    specs = [spec for spec in pipeline.nodes if spec.host == host]
    keys = [key for spec in specs for key in spec.outputs.values()]
    keys += [f"{name}/status/{spec.name}" for spec in specs]
    keys += [recent_key(key) for key in keys]
    # What an advanced publisher says beside its key, so that its last value can be had.
    keys += [f"{name}/status/{spec.name}/@adv/**" for spec in specs]
    keys += [f"{name}/{key}" for key in pipeline.hosts[host].grant]
    for word in CONTROL:
        keys += [f"{name}/{word}/{host}", f"{name}/{word}/{host}/**"]
    return keys + [f"{name}/@{order}/{host}/**" for order in ORDERS]


def reads(pipeline: Pipeline) -> list[str]:
    """Key expressions that every host of the pipeline may ask for and be sent."""
    name = pipeline.name
    beside = [f"{name}/*/*/@adv/**", recent_key(f"{name}/**")]
    return [f"{name}/**", *beside, *(f"{name}/{word}/**" for word in CONTROL)]


def granted_orders(pipeline: Pipeline, host: str) -> list[str]:
    """Which of `ORDERS` tools on a host may give; where a key has such a name, that is meant."""
    names = pipeline.hosts[host].grant
    return [
        order
        for order in ORDERS
        if order in names and f"{pipeline.name}/{order}" not in pipeline.external
    ]


def access_control(pipeline: Pipeline, host: str) -> dict[str, Any]:
    """zenoh's `access_control` for the gateway of `host`, by certificate names of the others."""
    others = [name for name in pipeline.hosts if name != host]
    words = [f"{pipeline.name}/@{order}/**" for order in ORDERS]
    rules = [
        _rule("local", ["ingress", "egress"], [*_READ, *_SEND], ["**", *reads(pipeline), *words]),
        _rule("read", ["ingress", "egress"], _READ, reads(pipeline)),
        _rule("hear", ["egress"], _SEND, reads(pipeline)),
        _rule("order", ["egress"], ["query"], words),  # whether it is heard, the other decides
        *(_rule(f"send-{name}", ["ingress"], _SEND, sends(pipeline, name)) for name in others),
        *(rule for name in others for rule in _obeyed(pipeline, name)),
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [
            {"id": "here", "link_protocols": ["unixsock-stream"]},
            *({"id": name, "cert_common_names": [name]} for name in others),
        ],
        "policies": [
            {"rules": ["local"], "subjects": ["here"]},
            *({"rules": _rules_of(pipeline, name), "subjects": [name]} for name in others),
        ],
    }


def _obeyed(pipeline: Pipeline, host: str) -> list[dict[str, Any]]:
    """Rules that let the tools of a host give orders here, and hear what came of them."""
    words = [f"{pipeline.name}/@{order}/**" for order in granted_orders(pipeline, host)]
    if not words:
        return []
    return [
        _rule(f"obey-{host}", ["ingress"], ["query"], words),
        _rule(f"answer-{host}", ["egress"], ["declare_queryable", "reply"], words),
    ]


def _rules_of(pipeline: Pipeline, host: str) -> list[str]:
    obeyed = [rule["id"] for rule in _obeyed(pipeline, host)]
    return ["read", "hear", "order", f"send-{host}", *obeyed]


def _rule(name: str, flows: list[str], messages: list[str], keys: Iterable[str]) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": messages,
        "key_exprs": sorted(set(keys)),
    }
