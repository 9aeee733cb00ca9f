"""What a check has to say: one finding per fault, and the list of them that speaks."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from flexspline.errors import InputError

__all__ = ["NO_TORSION", "Finding", "Findings", "Severity"]

Severity = Literal["error", "fault", "note"]

ORDER: tuple[Severity, ...] = ("error", "fault", "note")
NO_TORSION = ("wrapped_angle", "motor_reversed", "gear_ratio")
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
    remedy : the repair that mends it, as `read_log(repair=...)` takes it, or what else to do
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
class Findings(Sequence[Finding]):
    """All findings about one log, the worst first. `print` makes a table of them."""

    log_name: str
    items: tuple[Finding, ...] = ()

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

    def __str__(self) -> str:
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
        if not self.items:
            return f"<p>{html.escape(str(self))}</p>"
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


def sorted_findings(log_name: str, found: Sequence[Finding]) -> Findings:
    """Findings with the worst first, otherwise in the order of the checks."""
    return Findings(log_name, tuple(sorted(found, key=lambda f: ORDER.index(f.severity))))


def _cells(finding: Finding) -> tuple[str, str, str, str, str]:
    start, stop = finding.rows
    rows = f"{start}" if stop == start + 1 else f"{start}:{stop}"
    return finding.severity, finding.name, finding.channel, rows, finding.amount
