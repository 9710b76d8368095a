"""Walks through the nodes whose results can reach an output."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def contributing(node: Any) -> Iterator[Any]:
    """Yield every node whose result can reach ``node``, also nodes inside groups.

    A muted link passes nothing on. A muted node is not yielded: it only passes inputs on.
    """
    links_of_trees: dict[Any, Mapping[Any, Sequence[Any]]] = {}
    visited = set()
    pending = [node]
    while pending:
        node = pending.pop()
        if node in visited:
            continue
        visited.add(node)
        tree = node.id_data
        if tree not in links_of_trees:
            links_of_trees[tree] = _links_by_target(tree)
        links = links_of_trees[tree].get(node, ())
        if node.mute:
            passed_on = {link.from_socket for link in node.internal_links}
            pending += [link.from_node for link in links if link.to_socket in passed_on]
            continue
        pending += [link.from_node for link in links]
        yield node
        if getattr(node, "node_tree", None):
            pending += [n for n in node.node_tree.nodes if n.bl_idname == "NodeGroupOutput"]
        pending += _starts_of_zone(node)


def _links_by_target(tree: Any) -> Mapping[Any, Sequence[Any]]:
    """Return the links into each node of a tree. Blender itself searches all for each socket."""
    links = defaultdict(list)
    for link in tree.links:
        if not link.is_muted:
            links[link.to_node].append(link)
    return links


def _starts_of_zone(node: Any) -> list[Any]:
    """Return the start of a zone, such as a simulation, from its end. No link leads there."""
    if "Output" not in node.bl_idname:
        return []
    return [n for n in node.id_data.nodes if getattr(n, "paired_output_node", None) == node]
