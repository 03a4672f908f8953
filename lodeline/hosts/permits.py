"""Who may say what over the link: an access-control list derived from the pipeline.

A host may send the keys of its own nodes, and what tools on it were granted (`grant:`); it may
read everything of the pipeline. Whoever is not named in the pipeline may do nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # every node imports the bus, and the bus this
    from lodeline.pipeline.model import Pipeline

CONTROL = ("@claim", "@share", "@clock", "@ps", "@log")
"""What every supervisor says under its own host's name."""
_READ = ["declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"]
_SEND = ["put", "delete", "reply", "declare_queryable", "liveliness_token"]


def sends(pipeline: Pipeline, host: str) -> list[str]:
    """Key expressions that a host may send."""
    name = pipeline.name
    specs = [spec for spec in pipeline.nodes if spec.host == host]
    keys = [key for spec in specs for key in spec.outputs.values()]
    keys += [f"{name}/status/{spec.name}" for spec in specs]
    # What an advanced publisher says beside its key, so that its last value can be had.
    keys += [f"{name}/status/{spec.name}/@adv/**" for spec in specs]
    keys += [f"{name}/{key}" for key in pipeline.hosts[host].grant]
    for word in CONTROL:
        keys += [f"{name}/{word}/{host}", f"{name}/{word}/{host}/**"]
    return keys


def reads(pipeline: Pipeline) -> list[str]:
    """Key expressions that every host of the pipeline may ask for and be sent."""
    name = pipeline.name
    return [f"{name}/**", f"{name}/*/*/@adv/**", *(f"{name}/{word}/**" for word in CONTROL)]


def access_control(pipeline: Pipeline, host: str) -> dict[str, Any]:
    """zenoh's `access_control` for the gateway of `host`, by certificate names of the others."""
    others = [name for name in pipeline.hosts if name != host]
    rules = [
        _rule("local", ["ingress", "egress"], [*_READ, *_SEND], ["**", *reads(pipeline)]),
        _rule("read", ["ingress", "egress"], _READ, reads(pipeline)),
        _rule("hear", ["egress"], _SEND, reads(pipeline)),
        *(_rule(f"send-{name}", ["ingress"], _SEND, sends(pipeline, name)) for name in others),
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
            *({"rules": ["read", "hear", f"send-{name}"], "subjects": [name]} for name in others),
        ],
    }


def _rule(name: str, flows: list[str], messages: list[str], keys: Iterable[str]) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": flows,
        "messages": messages,
        "key_exprs": sorted(set(keys)),
    }
