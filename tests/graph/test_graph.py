"""Components and orders of random graphs, against their definitions by reachability."""

from __future__ import annotations

import random

import pytest

from servogen.graph import bottom_up, components

Graph = dict[int, list[int]]


def some_graph(seed: int) -> Graph:
    """Return a graph of up to nine nodes, some of which lead to themselves."""
    rng = random.Random(seed)
    nodes = rng.sample(range(20), rng.randint(0, 9))
    share = rng.choice((0.05, 0.15, 0.3))
    return {node: [other for other in nodes if rng.random() < share] for node in nodes}


def reached(graph: Graph, start: int) -> set[int]:
    """Return the nodes at the end of a path of at least one edge."""
    found: set[int] = set()
    waiting = list(graph[start])
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += graph[node]
    return found


GRAPHS = [some_graph(seed) for seed in range(300)]


def test_a_component_is_what_reaches_each_other_and_itself() -> None:
    for graph in GRAPHS:
        reach = {node: reached(graph, node) for node in graph}
        expected = {
            frozenset(other for other in graph if other in reach[node] and node in reach[other])
            for node in graph
            if node in reach[node]
        }
        parts = components(graph)
        assert {frozenset(part) for part in parts} == expected
        assert len(parts) == len(expected)
        assert sum(map(len, parts)) == sum(map(len, expected))


def test_the_graphs_have_components_of_all_sizes() -> None:
    sizes = {len(part) for graph in GRAPHS for part in components(graph)}
    assert {1, 2, 3, 4} <= sizes


@pytest.mark.parametrize("length", [1, 2, 5000])
def test_a_long_cycle_is_one_component_and_a_chain_none(length: int) -> None:
    ring = {node: [(node + 1) % length] for node in range(length)}
    assert sorted(components(ring)[0]) == list(range(length))
    chain = {node: [node + 1] for node in range(length)} | {length: []}
    assert components(chain) == []
    assert bottom_up(0, lambda node: chain[node]) == list(range(length, -1, -1))
    assert bottom_up(0, lambda node: ring[node]) is None


def test_an_order_has_each_node_after_those_that_it_leads_to() -> None:
    orders = 0
    for graph in GRAPHS:
        for start in graph:
            below = reached(graph, start) | {start}
            order = bottom_up(start, lambda node, graph=graph: graph[node])  # type: ignore[misc]
            if any(node in reached(graph, node) for node in below):
                assert order is None
                continue
            assert order is not None
            assert sorted(order) == sorted(below)
            assert order[-1] == start
            place = {node: number for number, node in enumerate(order)}
            assert all(place[after] < place[node] for node in order for after in graph[node])
            orders += len(order) > 2
    assert orders > 50
