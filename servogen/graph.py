"""Strongly connected components and longest paths of graphs.

In: a graph as nodes and their successors. Out: its components that contain a cycle; the longest path of an
acyclic graph.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def components(graph: Mapping[Node, Sequence[Node]]) -> list[list[Node]]:
    """Return the strongly connected components that contain a cycle (Tarjan 1972, without recursion)."""
    number: dict[Node, int] = {}
    low: dict[Node, int] = {}
    held: list[Node] = []
    on_hold: set[Node] = set()
    parts: list[list[Node]] = []
    for root in graph:
        if root in number:
            continue
        stack: list[tuple[Node, int]] = [(root, 0)]
        while stack:
            node, at = stack.pop()
            if at == 0:
                number[node] = low[node] = len(number)
                held.append(node)
                on_hold.add(node)
            followers = graph[node]
            if at and followers[at - 1] in on_hold:
                low[node] = min(low[node], low[followers[at - 1]])
            while at < len(followers):
                after = followers[at]
                at += 1
                if after not in number:
                    stack += [(node, at), (after, 0)]
                    break
                if after in on_hold:
                    low[node] = min(low[node], number[after])
            else:
                if low[node] == number[node]:
                    part = _taken(held, on_hold, node)
                    if len(part) > 1 or node in followers:
                        parts.append(part)
    return parts


def _taken(held: list[Node], on_hold: set[Node], node: Node) -> list[Node]:
    part: list[Node] = []
    while True:
        last = held.pop()
        on_hold.discard(last)
        part.append(last)
        if last == node:
            return part


def longest(start: Node, edges: Mapping[Node, Sequence[tuple[int, int | None, Node | None]]]) -> int | None:
    """Return the length of the longest path to the end (None) of an acyclic graph, ignoring dead ends."""
    done: dict[Node, int | None] = {}
    stack: list[tuple[Node, bool]] = [(start, False)]
    while stack:
        node, leaving = stack.pop()
        if leaving:
            lengths = [
                most if after is None else most + rest
                for _, most, after in edges[node]
                if most is not None
                for rest in [0 if after is None else done[after]]
                if rest is not None
            ]
            done[node] = max(lengths, default=None)
        elif node not in done:
            stack.append((node, True))
            stack += [
                (after, False) for _, _, after in edges[node] if after is not None and after not in done
            ]
    return done[start]
