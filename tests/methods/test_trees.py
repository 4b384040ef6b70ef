from fractions import Fraction
from math import comb

import pytest

from mbdae.methods.order.trees import iterate_y, plain_trees, trees_y, trees_z

ORDERS = range(1, 7)


def forests(counts, total):
    """Number of multisets of given total order, counts[k] kinds of order k (counted, not listed)."""
    ways = [1] + [0] * total
    for k, kinds in counts.items():
        ways = [
            sum(ways[n - k * m] * comb(max(kinds + m - 1, 0), m) for m in range(n // k + 1))
            for n in range(total + 1)
        ]
    return ways[total]


def count(largest, linear):
    """Numbers of trees in DAT2_y and DAT2_z from the definition alone."""
    y, z = {}, {}

    def roots(order, z):
        rest = order - 1
        if not linear:
            return forests({k: y.get(k, 0) + z.get(k, 0) for k in range(1, rest + 1)}, rest)
        return forests(y, rest) + sum(forests(y, rest - k) * z[k] for k in z if k <= rest)

    for order in range(1, largest + 1):
        y[order] = roots(order, z)
        without_single = roots(order + 1, z)  # z of this order is missing: no [u]_y with u alone
        z[order] = without_single + forests(y, order + 1)
        y[order + 1] = 0
    y.pop(largest + 1)
    return list(y.values()), list(z.values())


def test_number_of_trees():
    assert [len(trees_y(p)) for p in ORDERS] == [1, 3, 22, 192, 1972, 22057] == count(6, False)[0]
    assert [len(trees_z(p)) for p in range(1, 6)] == [2, 13, 112, 1131, 12579] == count(5, False)[1]
    linear = [sum(t.linear for t in trees_y(p)) for p in ORDERS]
    assert linear == [1, 3, 16, 102, 720, 5460] == count(6, True)[0]
    assert [len(plain_trees(p)) for p in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]


@pytest.mark.parametrize("order", ORDERS[:5])
def test_every_tree_is_allowed_and_listed_once(order):
    for fat, trees in ((False, trees_y(order)), (True, trees_z(order))):
        assert len({t.name for t in trees}) == len(trees)
        for tree in trees:
            assert tree.fat is fat
            assert tree.order == order == vertices(tree.name)
            if fat and len(tree.sons_y) == 1:
                (son,) = tree.sons_y
                assert son.name != "t"
                assert son.sons_y or len(son.sons_z) != 1


def vertices(name):
    """Order of a tree from its name: meagre minus fat vertices."""
    return name.count("t") + name.count("_y") - name.count("_z")


def test_names_and_densities():
    names = {t.name: t for p in (1, 2, 3) for t in (*trees_y(p), *trees_z(p))}
    assert [str(t) for t in trees_y(1)] == ["t"]
    assert [str(t) for t in trees_y(2)] == ["[t]_y", "[[[t]_y]_z]_y", "[[t,t]_z]_y"]
    assert names["[[t]_y]_y"].gamma == 6
    assert names["[t,t]_z"].gamma == Fraction(1, 2)
    assert names["[[t]_y]_z"].gamma == 1
    assert names["[t,[t,t]_z]_y"].gamma == Fraction(3, 2)
    assert not names["[[t,t]_z,[t,t]_z]_y"].linear
    assert names["[[t]_y]_y"].plain
    assert not names["[[t,t]_z]_y"].plain


def test_plain_trees_come_first():
    first = [t for t, _ in zip(iterate_y(5), plain_trees(5), strict=False)]
    assert tuple(first) == plain_trees(5)
    assert tuple(iterate_y(5)) == trees_y(5)
