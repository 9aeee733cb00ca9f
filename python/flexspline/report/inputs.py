"""How noisy the channels of some runs are, and how rows read them, for text and HTML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexspline.formatting.numbers import plus_minus, short
from flexspline.logs.channels import CHANNELS

if TYPE_CHECKING:
    from flexspline.least_squares.result import Delay
    from flexspline.logs.channel_noise import ChannelNoise
    from flexspline.prepared import Preparation

__all__ = ["HEADING", "delay_sentence", "input_rows", "smoothed_rows"]

AS_RECORDED = "as recorded"
HEADING = ("channel", "noise, RMS", "quantum", "bandwidth [Hz]", "as the rows read it")

Row = tuple[str, ...]


def input_rows(inputs: Sequence[ChannelNoise], ways: Sequence[Preparation]) -> list[Row]:
    """Return channel with unit, noise, quantum, bandwidth and how rows read it, for a table.

    Parameters
    ----------
    inputs : noise of the channels of the runs.
    ways : how channels are made before rows read them; some may be in no run.
    """
    used = {way.channel: way.how for way in ways}
    own = {noise.channel for noise in inputs}
    told: list[Row] = [
        (
            _named(noise.channel),
            short(noise.noise),
            short(noise.quantum) if noise.quantum else "–",
            f"{noise.bandwidth:.3g}" if noise.noisy else f"above {noise.bandwidth:.3g}",
            used.get(noise.channel, AS_RECORDED),
        )
        for noise in inputs
    ]
    return told + [(_named(w.channel), "–", "–", "–", w.how) for w in ways if w.channel not in own]


def smoothed_rows(
    inputs: Sequence[ChannelNoise], ways: Sequence[Preparation], read: Sequence[str]
) -> list[Row]:
    """Return heading and those rows of the table whose channel is `read` other than recorded."""
    names = {_named(way.channel) for way in ways if way.channel in read}
    rows = [row for row in input_rows(inputs, ways) if row[0] in names]
    return [HEADING, *rows] if rows else []


def delay_sentence(delay: Delay | None, unit: str) -> str:
    """Return by how much the load is late, and what that does; "" where it was not looked for."""
    if delay is None:
        return ""
    late = plus_minus(1e3 * delay.seconds, 1e3 * delay.standard_error)
    return (
        f"{delay.channel} is {late} ms later than the target; coefficients are those beside this "
        f"delay, which makes {short(delay.rmse)} {unit} of the residual."
    )


def _named(channel: str) -> str:
    return f"{channel} [{CHANNELS[channel].unit if channel in CHANNELS else 'Nm'}]"
