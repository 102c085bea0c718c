"""What a graph's nodes lead to: reachable nodes, strongly connected components, orders without cycles.

In: a graph as nodes and their successors. Out: the nodes that can be reached; its components that contain a
cycle; the nodes below a node, each after its successors.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def reached(
    starts: Iterable[Node],
    successors: Callable[[Node], Iterable[Node]],
    is_new: Callable[[Node], bool] | None = None,
) -> Iterator[Node]:
    """Yield the nodes that can be reached from `starts`, these included, each once; the latest found first.

    The successors of a node are asked for when the next node is, so whoever has seen enough can stop.
    `is_new`, asked for each way to a node, decides whether it is followed; without it, nodes that were not
    met before are.
    """
    found: set[Node] = set()

    def is_first(node: Node) -> bool:
        if node in found:
            return False
        found.add(node)
        return True

    followed = is_new or is_first
    waiting = [node for node in starts if followed(node)]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += [after for after in successors(node) if followed(after)]


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
            node, next_index = stack.pop()
            if next_index == 0:
                number[node] = low[node] = len(number)
                held.append(node)
                on_hold.add(node)
            followers = graph[node]
            if next_index and followers[next_index - 1] in on_hold:
                low[node] = min(low[node], low[followers[next_index - 1]])
            while next_index < len(followers):
                after = followers[next_index]
                next_index += 1
                if after not in number:
                    stack += [(node, next_index), (after, 0)]
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


def bottom_up(start: Node, successors: Callable[[Node], Iterable[Node]]) -> list[Node] | None:
    """Return the nodes that can be reached from a node, each after all those that it leads to; None if they
    contain a cycle.
    """
    order: list[Node] = []
    finished: dict[Node, bool] = {start: False}
    stack = [(start, iter(successors(start)))]
    while stack:
        node, rest = stack[-1]
        for after in rest:
            done = finished.get(after)
            if done is None:
                finished[after] = False
                stack.append((after, iter(successors(after))))
                break
            if not done:
                return None
        else:
            stack.pop()
            finished[node] = True
            order.append(node)
    return order
