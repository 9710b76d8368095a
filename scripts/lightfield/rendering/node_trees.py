"""Walks through the nodes whose results can reach an output."""

from collections.abc import Iterator
from typing import Any


def contributing(node: Any) -> Iterator[Any]:
    """Yield every node whose result can reach ``node``, also nodes inside groups.

    A muted link passes nothing on. A muted node is not yielded: it only passes inputs on.
    """
    visited = set()
    pending = [node]
    while pending:
        node = pending.pop()
        if node in visited:
            continue
        visited.add(node)
        pending += [
            link.from_node
            for socket in _sockets(node)
            for link in socket.links
            if not link.is_muted
        ]
        if node.mute:
            continue
        yield node
        if getattr(node, "node_tree", None):
            pending += [n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput"]
        pending += _starts_of_zone(node)


def _sockets(node: Any) -> list[Any]:
    """Return the inputs of a node that can change its outputs."""
    return [link.from_socket for link in node.internal_links] if node.mute else list(node.inputs)


def _starts_of_zone(node: Any) -> list[Any]:
    """Return the start of a zone, such as a simulation, from its end. No link leads there."""
    if "Output" not in node.bl_idname:
        return []
    return [n for n in node.id_data.nodes if getattr(n, "paired_output_node", None) == node]
