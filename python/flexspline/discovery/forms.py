"""What the form of a named effect may miss, and another effect may then seem to explain.

No form is exact: what a named effect's own misses is a share of all that it explains, and beside a
large effect that is as much as a small one explains. Where the named effect has a smooth form, the
form can be freed: beside all functions of its channels another effect either still pays its price,
and is there, or does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np

from flexspline.discovery.dictionary import Dictionary
from flexspline.discovery.evidence import evidence_of, gain_of
from flexspline.discovery.nameless import Nameless, channel_told, nameless_of
from flexspline.discovery.physics import LOOPS, WIDTH, one_signed
from flexspline.discovery.scores import Offer
from flexspline.discovery.settings import SETTINGS
from flexspline.discovery.study import Study
from flexspline.discovery.table import tabulated
from flexspline.discovery.whitening import Whitening
from flexspline.discovery.working import Working
from flexspline.effects import Effect
from flexspline.fit.problem import Problem

__all__ = ["missed", "owned_gain", "owned_price", "pays_beside_forms", "undecided"]

SUSPECTED = 0.5  # of a gain, that a form may miss, to be freed before that gain is believed
SAME_CAUSE = 0.5  # of an offer's gain, that another one leaves of it, to explain most of the same


def owned_gain(dictionary: Dictionary, name: str) -> float:
    """Squares over σ² that an effect of the model explains beside all others."""
    rest = dictionary.without([name])
    own = dictionary.model[np.array(dictionary.owners) == name]
    left = dictionary.table.without(rest)
    return gain_of(left, own, np.diag(dictionary.table.total))[0]


def owned_price(dictionary: Dictionary, effect: Effect, rivals: int) -> float:
    """What an effect of the model pays beside all others, its shapes known.

    Springs that were held because they would drive were chosen: out of as many ways are those that
    are left.
    """
    left = dictionary.table.without(dictionary.without([effect.name]))
    raw = np.diag(dictionary.table.total)
    columns = dictionary.coefficients(effect.name)
    signs = one_signed(effect.name, dictionary.target)
    ways = comb(len(effect.terms), len(columns)) if effect.name in LOOPS else 1
    return evidence_of(effect.name, signs, left, columns, raw).price(float(ways), rivals)


def missed(dictionary: Dictionary, named: Sequence[Effect], other: Effect) -> float:
    """What the forms of named effects may miss, and another effect may seem to explain, in χ²."""
    return max((_missed_by(dictionary, effect, other) for effect in named), default=0.0)


def _missed_by(dictionary: Dictionary, named: Effect, other: Effect) -> float:
    bends = bool(other.reads) and set(other.reads) <= set(named.reads)  # a constant bends nothing
    share = SETTINGS.bends if bends else _share(named)
    return share * owned_gain(dictionary, named.name)


def undecided(
    offer: Offer, others: Sequence[Offer], dictionary: Dictionary, named: Sequence[Effect]
) -> str:
    """An offer that explains most of the same, as well but for what the forms of names may miss.

    That moves every gain by about as much: a smaller lead does not tell causes apart. Where runs
    show both as the same, they are aliases, which is said elsewhere.
    """
    unsure = max((_share(e) * owned_gain(dictionary, e.name) for e in named), default=0.0)
    raw = np.diag(dictionary.table.total)
    for other in others:
        if other is offer or abs(offer.gain - other.gain) >= unsure:
            continue
        both = np.concatenate([dictionary.model, other.columns])
        kept = gain_of(dictionary.table.without(both), offer.columns, raw)[0]
        if offer.price < kept < SAME_CAUSE * offer.gain:
            return other.effect.name
    return ""


def pays_beside_forms(
    study: Study, whitening: Whitening, dictionary: Dictionary, work: Working, effect: Effect,
    gain: float,
) -> bool:  # fmt: skip
    """Whether an effect clearly pays its price beside a model whose suspected forms are freed.

    Suspected is each name that may miss half of `gain`, which the effect gains beside the forms as
    they are. It does not where one of them cannot be freed, or where what is freed holds the
    effect's own channels, too. Of long logs a part is looked at.
    """
    names = [e for e in work.named if e.name != effect.name]
    suspected = [e for e in names if _missed_by(dictionary, e, effect) > SUSPECTED * gain]
    if any(set(effect.reads) <= set(e.reads) for e in suspected):
        return False
    problem = study.thinned().problem
    freed = [_functions(problem, e) for e in suspected]
    if not all(freed):
        return False
    rest = work.having([e for e in work.effects if e.name != effect.name])
    functions = [group for groups in freed for group in groups]
    table = tabulated(problem, rest.sheet(beside=[effect], functions=functions), whitening)
    first, count = len(rest.owners()), len(effect.terms)
    columns = np.arange(first, first + count)
    left = table.without(np.setdiff1d(np.arange(len(table.total) - 1), columns))
    signs = one_signed(effect.name, dictionary.target)
    told = evidence_of(effect.name, signs, left, columns, np.diag(table.total))
    return told.gain >= SETTINGS.freed * told.price(1.0, len(dictionary.candidates))


def _functions(problem: Problem, effect: Effect) -> list[Nameless]:
    """All functions of no other channels than those of an effect, and of what these have been.

    Empty where they cannot take its place: it remembers, changes at once with the direction, is a
    wave, or a channel of it is not measured.
    """
    if effect.ripple or effect.info.remembers or WIDTH in effect.shapes:
        return []
    load = problem.known_load
    own = {load if name == "load" else name for name in effect.reads}
    told = [({channel_told(c, load) for c in g.channels}, g) for g in nameless_of(problem)]
    found = [group for channels, group in told if channels <= own]
    covered = {name for channels, _ in told if channels <= own for name in channels}
    return found if own <= covered else []


def _share(named: Effect) -> float:
    """Of the gain of a named effect, what its form may miss."""
    return SETTINGS.memory if named.info.remembers else SETTINGS.form
