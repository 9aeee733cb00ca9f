"""Units of foreign columns, by pint."""

from __future__ import annotations

import functools
from typing import Any

from flexspline.errors import InputError
from flexspline.logs.channels import CHANNELS

__all__ = ["to_si"]

_PINT_NAMES = {
    "": "dimensionless",
    "-": "dimensionless",
    "–": "dimensionless",
    "0/1": "dimensionless",
    "°C": "degC",
}


def to_si(channel: str, unit: str) -> tuple[float, float]:
    """Return (factor, offset) with value in the channel's SI unit = factor · x + offset.

    Parameters
    ----------
    channel : str
        A name of `CHANNELS`.
    unit : str
        Anything pint understands: "deg", "rpm", "mNm", "mV", "degC", "%" ...
        "Nm" is newton metre. The empty text is a plain number.

    Raises
    ------
    InputError
        Where the unit is unknown, or measures something else than the channel.
    """
    wanted = CHANNELS[channel].unit
    registry = _registry()
    try:
        source = registry.Unit(_PINT_NAMES.get(str(unit).strip(), unit))
    except Exception as error:  # pint raises many kinds, its parser's and tokenizer's among them
        raise InputError(
            f"channel '{channel}': unit '{unit}' is not known; "
            f"give one such as '{_example(wanted)}'"
        ) from error
    target = registry.Unit(_PINT_NAMES.get(wanted, wanted))
    if registry.get_root_units(source)[1] != registry.get_root_units(target)[1]:
        raise InputError(
            f"channel '{channel}': unit '{unit}' does not measure what is in "
            f"{wanted}; give one such as '{_example(wanted)}'"
        )
    zero, one, far = (
        float(registry.Quantity(x, source).to(target).magnitude) for x in (0.0, 1.0, 1e6)
    )
    return ((far - zero) / 1e6 if zero else one), zero  # far: an offset costs no digits


@functools.cache
def _registry() -> Any:
    """Return pint with newton metres.

    Units are compared by their root units, where an angle counts: to pint's dimensions
    1 Hz is 1 rad/s and a percentage is an angle; here both are errors.
    """
    import pint

    registry: Any = pint.UnitRegistry()
    registry.define("newton_metre = newton * metre = Nm")
    registry.define("newton_centimetre = 0.01 * newton * metre = Ncm")
    registry.define("@alias revolution = rev")
    return registry


def _example(wanted: str) -> str:
    return {
        "rad": "deg",
        "rad/s": "rpm",
        "rad/s²": "deg/s^2",
        "Nm": "mNm",
        "A": "mA",
        "V": "mV",
        "°C": "degC",
        "s": "ms",
    }.get(wanted, "%")
