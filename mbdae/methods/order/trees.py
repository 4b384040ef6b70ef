"""Rooted trees of index-2 order theory, enumerated by order.

A meagre vertex represents f (a component of y), a fat one the implicit function z. With tau one meagre
vertex, the trees of the Taylor series of y and z in y' = f(y, z), 0 = g(y) are

    DAT2_y:  tau;  [t_1..t_k, u_1..u_l]_y            with t_i in DAT2_y, u_j in DAT2_z
    DAT2_z:  [t_1..t_m]_z                            with m > 1, or m = 1 and t_1 neither tau nor [u]_y

(the excluded trees cancel by g_y f = 0 and (g_y f_z)^-1 g_y f_z = 1). The order rho of a tree is the
number of its meagre vertices minus that of its fat ones. Source: E. Hairer, Ch. Lubich and M. Roche, The
Numerical Solution of Differential-Algebraic Systems by Runge-Kutta Methods, Springer 1989, chapter 5.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from itertools import chain, combinations_with_replacement, product
from math import prod


@dataclass(frozen=True, eq=False)
class RootedTree:
    """A tree of DAT2_y or DAT2_z; every tree exists once, so that equality is identity.

    Args:
        fat: the root is fat, the tree belongs to DAT2_z.
        sons_y: subtrees with a meagre root.
        sons_z: subtrees with a fat root (below a meagre root only).
        name: the tree in brackets, as in the module.

    Attributes:
        order: rho, the number of meagre vertices minus that of fat ones.
        gamma: 1 for tau, rho prod gamma(sons) for [..]_y, prod gamma(sons) / (rho + 1) for [..]_z.
        linear: appears when f is linear in z, as in mechanics: no vertex has two fat sons.
        plain: has no fat vertices, as the trees of ordinary differential equations.
    """

    fat: bool
    sons_y: tuple["RootedTree", ...]
    sons_z: tuple["RootedTree", ...]
    name: str
    order: int = field(init=False)
    gamma: Fraction = field(init=False)
    linear: bool = field(init=False)
    plain: bool = field(init=False)

    def __post_init__(self) -> None:
        sons = self.sons_y + self.sons_z
        order = sum(t.order for t in sons) + (-1 if self.fat else 1)
        gamma = prod((t.gamma for t in sons), start=Fraction(1))
        self.__dict__.update(
            order=order,
            gamma=gamma / (order + 1) if self.fat else gamma * order,
            linear=len(self.sons_z) < 2 and all(t.linear for t in sons),
            plain=not self.fat and all(t.plain for t in sons),
        )

    def __str__(self) -> str:
        return self.name


_KNOWN: dict[str, RootedTree] = {}


def _tree(fat: bool, sons: tuple[RootedTree, ...]) -> RootedTree:
    sons = tuple(sorted(sons, key=lambda t: (t.fat, t.order, t.name)))
    name = f"[{','.join(t.name for t in sons)}]_{'z' if fat else 'y'}" if sons else "t"
    if name not in _KNOWN:
        sons_y, sons_z = (tuple(t for t in sons if t.fat is kind) for kind in (False, True))
        _KNOWN[name] = RootedTree(fat, sons_y, sons_z, name)
    return _KNOWN[name]


@cache
def plain_trees(order: int) -> tuple[RootedTree, ...]:
    """Return the trees of ordinary differential equations: 1, 1, 2, 4, 9, 20, 48 of orders 1 to 7."""
    return tuple(_tree(False, sons) for sons in _forests(order - 1, plain_trees))


@cache
def trees_y(order: int) -> tuple[RootedTree, ...]:
    """Return DAT2_y of one order, the plain trees first: 1, 3, 22, 192, 1972, 22057 trees of orders 1 to 6."""
    single = tuple(_tree(False, (u,)) for u in trees_z(order - 1))
    return plain_trees(order) + _branched(order) + single


@cache
def trees_z(order: int) -> tuple[RootedTree, ...]:
    """Return DAT2_z of one order: 2, 13, 112, 1131, 12579 trees of orders 1 to 5."""
    if order < 1:
        return ()
    single = (t for t in plain_trees(order + 1) + _branched(order + 1))
    multiple = (sons for sons in _forests(order + 1, trees_y, largest=order))
    return tuple(_tree(True, sons) for sons in chain(((t,) for t in single), multiple))


def iterate_y(order: int) -> Iterator[RootedTree]:
    """Yield DAT2_y of one order; all trees except plain ones are built on demand."""
    yield from plain_trees(order)
    yield from trees_y(order)[len(plain_trees(order)) :]


@cache
def _branched(order: int) -> tuple[RootedTree, ...]:
    """Return DAT2_y of one order without the plain trees and the trees [u]_y, which depend on DAT2_z of order - 1."""
    pool = _forests(order - 1, lambda k: trees_y(k) + (trees_z(k) if k < order - 1 else ()))
    trees = (_tree(False, sons) for sons in pool)
    return tuple(t for t in trees if not t.plain)


def _forests(
    total: int, pool: Callable[[int], tuple[RootedTree, ...]], largest: int | None = None
) -> Iterator[tuple[RootedTree, ...]]:
    """Yield every multiset of trees whose orders add up to ``total``."""
    for partition in _partitions(total, total if largest is None else largest):
        choices = [combinations_with_replacement(pool(k), partition.count(k)) for k in sorted(set(partition))]
        for choice in product(*choices):
            yield tuple(chain.from_iterable(choice))


def _partitions(total: int, largest: int) -> Iterator[tuple[int, ...]]:
    if total == 0:
        yield ()
    for k in range(min(total, largest), 0, -1):
        for rest in _partitions(total - k, k):
            yield (k, *rest)
