"""What there is to say of a comparison in tables, for text and HTML alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flexspline.comparison.bands import Band, worst_band
from flexspline.comparison.result import ranked, sized

if TYPE_CHECKING:
    from flexspline.comparison.result import Comparison

__all__ = [
    "band_tables",
    "base_told",
    "followed",
    "order_rows",
    "worst_rows",
]

Row = tuple[str, ...]

LEAST_CHANCE = 1e-9
LONGEST_LABEL = 34
MOST_ORDERS = 8


def base_told(made: Comparison) -> list[str]:
    """Return what there is to say of a foreign simulation that is the base, and of the rows."""
    if not made.foreign:
        return [*made.notes]
    return [f"The base is what a simulation says: {made.foreign}.", *made.notes]


def worst_rows(made: Comparison) -> list[Row]:
    """Return heading and rows: all rows, then the worst band of each covariate."""
    unit = made.unit
    head = ("worst band of", "", "rows", f"RMSE [{unit}]", "noise floor", "excess", "bias")
    rows = [head, ("all rows", "", *_numbers(made.overall, made.noise_floor))]
    for name in ranked(made):
        band = worst_band(made.by[name])
        label = _short(band.label)
        rows.append((made.words[name], label, *_numbers(band, made.noise_floor)))
    return rows


def followed(made: Comparison) -> list[str]:
    """Return a sentence for each thing that the gap follows."""
    return [
        f"follows {f.words}: {_percent(f.share)} of the gap's square above the floor, "
        f"chance {_chance(f.chance)}"
        + (f"; nearly as well: {', '.join(f.also)}" if f.also else "")
        + "."
        for f in made.follows
    ]


def order_rows(made: Comparison) -> list[Row]:
    """Return heading and rows of the orders found."""
    head = ("order per output turn", "what turns", f"amplitude [{made.unit}]", "chance")
    found: list[Row] = [head]
    for peak in made.orders[:MOST_ORDERS]:
        size = f"{sized(peak.amplitude, peak.error)} ± {sized(peak.error, peak.error)}"
        found.append((f"{peak.per_output_turn:.6g}", peak.label, size, _chance(peak.chance)))
    return found


def band_tables(made: Comparison) -> list[tuple[str, list[Row]]]:
    """Return title and rows of every covariate, for the report."""
    floor = made.noise_floor
    return [
        (
            made.words[name],
            [
                (band.label, *_numbers(band, floor), f"{band.variance:.3g}",
                 f"{band.effective_rows:.0f}", _chance(band.chance) if band.significant else "–")
                for band in made.by[name]
            ],
        )
        for name in ranked(made)
    ]  # fmt: skip


def _numbers(band: Band, floor: float) -> Row:
    error = f" ± {sized(band.noise_floor_error, 0.1 * floor)}"
    return (
        str(band.rows),
        sized(band.rmse, 0.1 * floor),
        sized(band.noise_floor, 0.1 * floor) + error,
        sized(band.excess, 0.1 * floor) if band.significant else "–",
        sized(band.bias + 0.0, 0.1 * floor),
    )


def _short(label: str) -> str:
    return label if len(label) <= LONGEST_LABEL else label[: LONGEST_LABEL - 2] + " …"


def _percent(share: float) -> str:
    return f"{100.0 * min(share, 1.0):.0f} %"


def _chance(chance: float) -> str:
    return f"{chance:.0e}" if chance >= LEAST_CHANCE else "below 1e-09"
