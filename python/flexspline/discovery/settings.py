"""The numbers that decide what `discover` says, each with what it stands for.

What halving and doubling each of them does to the names of the benchmark is printed by

    python tests/bench/settings_table.py --class robot --out DIR
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SETTINGS", "Settings"]


@dataclass(frozen=True)
class Settings:
    """Shares are of one; counts are of columns, rows or candidates.

    Parameters
    ----------
    alpha : level of every test: that logs which hide nothing get a name, that a coefficient is
        zero. The bar of the benchmark is two per cent, and a log is searched several times.
    negligible : of squares, times or rows, that matters to nobody: an error that it raises is the
        same to three digits.
    form : of its gain, that the form of a name misses: bearings' and gears' forms are known to
        some per cent, whose squares these are.
    memory : the same of an effect with memory, whose loops have more ways to differ.
    bends : the same for a candidate that reads nothing but the name's channels and may bend it; and
        of a gap, what is no second name.
    little, most : of anything: a small part of it, nearly all of it.
    retained : of its gain, that a name keeps beside functions of the channels, or it is spurious.
        Once a judgement on two measured joints; half and twice change no name of 60 robot cases.
    freed : times its threshold, that an effect gains beside freed forms: functions are few.
    overwhelming : times its gain, that is left beside a name: the name may be a part of that.
    told : standard errors up to which two are indistinguishable.
    certain : t above which held-out errors fall by more than chance: of a name, in the report's
        own law; and up to which a name may be what the form of a larger one misses.
    names : that one search takes at most.
    tried : the best so many are looked at more closely; orders of a part that are tried unasked.
    points : values of one shape that are screened, and lags of a channel.
    functions : of one channel; orders that a scan has found and are tried, and, where low ones of
        the output may be there, the highest of these. Of 60 robot cases half loses one and names a
        wrong one, twice changes none.
    lines : orders of the motor's angle that are looked at one by one.
    rows : on which names are looked for first, and functions of a flexible basis looked at; powers
        alone on `rows / little`.
    """

    alpha: float = 0.005
    negligible: float = 0.01
    form: float = 0.007
    memory: float = 0.03
    bends: float = 0.05
    little: float = 0.1
    most: float = 0.8
    retained: float = 0.4
    freed: float = 1.25
    overwhelming: float = 5.0
    told: float = 3.0
    certain: float = 16.0
    names: int = 8
    tried: int = 4
    points: int = 6
    functions: int = 20
    lines: int = 48
    rows: int = 10_000

    @property
    def doubtful(self) -> float:
        """χ² of half of `certain`: what explains less may be of another form or effect."""
        return (0.5 * self.certain) ** 2


SETTINGS = Settings()
