"""Sums over logs that need not fit into memory."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flexspline import _core
from flexspline.effects import Effect, effect, require_effects
from flexspline.errors import InputError
from flexspline.least_squares.sums import Sums, joined
from flexspline.logs.log import Log
from flexspline.requirements import gear_for, require_finite, require_load
from flexspline.signals import channels_for, core_channels, target_of

__all__ = ["accumulate"]

BLOCK = 1 << 17


def accumulate(
    effects: Iterable[str | Effect],
    logs: Iterable[Log],
    target: str,
    *,
    known_load: str | None = None,
    exact: bool = False,
    threads: int = 1,
) -> Sums:
    """Sum the products of rows and target over logs, one at a time.

    Parameters
    ----------
    effects : with their shapes and orders; nothing is searched for.
    logs : read one after the other; a generator of pieces of a long log keeps memory constant.
        Pieces are summed by themselves: a velocity that is to be derived must be there already.
    target, known_load : as for `fit`. Effects that depend on the load see the known load alone.
    exact : sum in double-double, for designs with a condition number above 1e3.
    threads : for the blocks of each log.

    Returns
    -------
    Sums
        One block for each log: add them up, pickle them, leave some out, solve.

    Raises
    ------
    InputError
        As `fit`, and where there is no log.
    """
    chosen = [e if isinstance(e, Effect) else effect(e) for e in effects]
    for e in chosen:
        if e.info.remembers:
            raise InputError(
                f"effect '{e.name}' remembers what came before a piece of a log; fit whole runs "
                "or leave it out"
            )
    require_effects(chosen, target)
    require_load(chosen, known_load)
    pieces = []
    for number, log in enumerate(logs):
        log = channels_for(log, chosen, known_load)
        channels = core_channels(log, chosen, known_load)
        y = target_of(log, target, known_load)
        design = _core.Design([e.for_core() for e in chosen], **gear_for([log], target, chosen))
        blocks = [(i, min(i + BLOCK, len(log))) for i in range(0, len(log), BLOCK)]
        nothing = np.empty(0)
        high, low = design.accumulate(
            channels, y, blocks, nothing, nothing, None, exact, True, threads
        )
        if not np.isfinite(high).all():
            require_finite(log, {**channels, target: y})
        high, low = _core.merge(high, low, list(range(len(blocks))))
        rows, label = np.array([len(log)]), np.array([number])
        pieces.append(Sums(high[None], low.reshape(-1, *high.shape), rows, label))
    if not pieces:
        raise InputError("there is no log to sum over; give at least one")
    return joined(pieces)
