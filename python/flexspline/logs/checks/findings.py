"""What a check has to say: one finding per fault, and the list of them that speaks."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from flexspline.errors import InputError
from flexspline.formatting import rows_html

__all__ = ["EXCITED", "NO_TORSION", "Excited", "Finding", "Findings", "Severity"]

Severity = Literal["error", "fault", "note"]

ORDER: tuple[Severity, ...] = ("error", "fault", "note")
NO_TORSION = ("wrapped_angle", "motor_reversed", "gear_ratio", "position_unit", "position_scale")
"""Faults with which q Ñ − θ is hundreds of rad of nothing; of other targets they are warnings."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a log, or worth knowing about it.

    Attributes
    ----------
    name : stable identifier, such as ``velocity_delay``
    severity : ``error`` (a fit would be meaningless), ``fault`` (the data are not what they say;
        a fit would take it for physics) or ``note`` (worth knowing)
    channel : the channel concerned
    rows : half-open row range in which it occurs; of single rows, from the first to the last
    size : how much, in `unit`
    unit : SI unit of `size`, "" for a count or a factor
    sentence : what is wrong, where, how much
    remedy : the repair that fixes it, as `read_log(repair=...)` takes it, or what else to do
    """

    name: str
    severity: Severity
    channel: str
    rows: tuple[int, int]
    size: float
    unit: str
    sentence: str
    remedy: str = ""

    @property
    def amount(self) -> str:
        """`size` with its unit, such as "0.031 s"; rows are counted to the last one."""
        shown = f"{self.size:.0f}" if self.unit == "rows" else f"{self.size:.4g}"
        return f"{shown} {self.unit}".strip()


@dataclass(frozen=True)
class Excited:
    """Whether a run excites an effect: whether it holds what that takes to be seen.

    Attributes
    ----------
    effect : its name in the catalogue
    excited : False where the run lacks something, None where it has no channel for the effect
    lack : what the run lacks, in words; "" where it is excited
    remedy : what to record; where it is excited, what it takes beside that, or ""
    """

    effect: str
    excited: bool | None
    lack: str = ""
    remedy: str = ""

    @property
    def said(self) -> str:
        """What is lacking and what to do, in a sentence or two."""
        return f"{self.lack}. {self.remedy}" if self.lack else self.remedy


@dataclass(frozen=True)
class Findings(Sequence[Finding]):
    """All findings about one log, the worst first. `print` makes a table of them.

    `excited`: of each effect, whether the run excites it; none of a run with errors.
    """

    log_name: str
    items: tuple[Finding, ...] = ()
    excited: tuple[Excited, ...] = ()

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.items)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]  # int or slice, as in a tuple
        return self.items[index]

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings that make every fit meaningless."""
        return self._of("error")

    @property
    def faults(self) -> tuple[Finding, ...]:
        """Findings that a fit would take for physics."""
        return self._of("fault")

    @property
    def notes(self) -> tuple[Finding, ...]:
        """Findings that are worth knowing."""
        return self._of("note")

    def named(self, name: str) -> tuple[Finding, ...]:
        """Findings of one name."""
        return tuple(f for f in self.items if f.name == name)

    def forbidding(self, target: str | None = None) -> tuple[Finding, ...]:
        """Findings with which no fit is made: errors, and of torsion what makes nonsense of it."""
        wrong = NO_TORSION if target == "torsion" else ()
        return tuple(f for f in self.items if f.severity == "error" or f.name in wrong)

    def raise_errors(self) -> None:
        """Raise `InputError` with the first error's sentence and remedy, if there is one."""
        self._raise(self.errors)

    def raise_forbidding(self, target: str | None) -> None:
        """Raise `InputError` with the first finding that forbids a fit of this target."""
        self._raise(self.forbidding(target))

    def raise_named(self, names: Iterable[str]) -> None:
        """Raise `InputError` with the first finding of these names, whatever its severity."""
        self._raise([finding for name in names for finding in self.named(name)])

    def _raise(self, found: Sequence[Finding]) -> None:
        if found:
            first, more = found[0], f" ({len(found) - 1} more)" if len(found) > 1 else ""
            raise InputError(f"{self.log_name}: {first.sentence} {first.remedy}".strip() + more)

    def __repr__(self) -> str:
        return f"<Findings of {self.log_name!r}: {self._count() or 'nothing found'}>"

    def __str__(self) -> str:
        return "\n".join([self._found(), *excitation_lines(self.excited)])

    def _found(self) -> str:
        if not self.items:
            return f"{self.log_name}: nothing found"
        head = ("severity", "name", "channel", "rows", "size")
        table = [head, *(_cells(f) for f in self.items)]
        width = [max(len(row[i]) for row in table) for i in range(len(head))]
        lines = [f"{self.log_name}: {self._count()}"]
        for row, finding in zip(table, (None, *self.items), strict=True):
            lines.append("  ".join(c.ljust(w) for c, w in zip(row, width, strict=True)).rstrip())
            if finding is not None:
                lines.append(f"    {finding.sentence} {finding.remedy}".rstrip())
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return self._found_html() + excitation_html(self.excited)

    def _found_html(self) -> str:
        if not self.items:
            return f"<p>{html.escape(self._found())}</p>"
        head = ("severity", "name", "channel", "rows", "size", "what", "remedy")
        body = (
            "<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells) + "</tr>"
            for cells in ((*_cells(f), f.sentence, f.remedy) for f in self.items)
        )
        return (
            f"<p>{html.escape(self.log_name)}: {self._count()}</p><table><tr>"
            + "".join(f"<th>{h}</th>" for h in head)
            + f"</tr>{''.join(body)}</table>"
        )

    def _of(self, severity: Severity) -> tuple[Finding, ...]:
        return tuple(f for f in self.items if f.severity == severity)

    def _count(self) -> str:
        counts = ((len(self._of(s)), s) for s in ORDER)
        return ", ".join(f"{n} {s}{'' if n == 1 else 's'}" for n, s in counts if n)


def sorted_findings(
    log_name: str, found: Sequence[Finding], excited: Sequence[Excited] = ()
) -> Findings:
    """Findings with the worst first, otherwise in the order of the checks."""
    worst_first = tuple(sorted(found, key=lambda f: ORDER.index(f.severity)))
    return Findings(log_name, worst_first, tuple(excited))


EXCITED: Final = {True: "yes", False: "hardly", None: "not known"}
HEADS: Final = {
    True: "excited (a fit may still not tell them apart):",
    False: "hardly excited (what a fit finds there may be another effect's):",
    None: "not known whether excited:",
}


def excitation_lines(excited: Sequence[Excited]) -> list[str]:
    """Lines on what runs excite, and on what they hardly do and why."""
    lines = []
    for state, head in HEADS.items():
        why: dict[str, list[str]] = {}
        for one in excited:
            if one.excited is state:
                why.setdefault(one.said, []).append(one.effect)
        lines += [head] if why else []
        for said, names in why.items():
            lines += _wrapped(": ".join([", ".join(names), *([said] if said else [])]), "  ")
    return lines


def excitation_html(excited: Sequence[Excited]) -> str:
    """A table of what runs excite, "" for none."""
    if not excited:
        return ""
    rows = [(one.effect, EXCITED[one.excited], one.lack, one.remedy) for one in excited]
    head = ("effect", "excited", "what is lacking", "what to do")
    return f"<table>{rows_html([head, *rows])}</table>"


def _wrapped(sentence: str, indent: str = "") -> list[str]:
    """A sentence in lines of at most 100 characters, all but the first further indented."""
    return textwrap.wrap(
        sentence,
        100,
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_on_hyphens=False,
    )


def _cells(finding: Finding) -> tuple[str, str, str, str, str]:
    start, stop = finding.rows
    rows = f"{start}" if stop == start + 1 else f"{start}:{stop}"
    return finding.severity, finding.name, finding.channel, rows, finding.amount
