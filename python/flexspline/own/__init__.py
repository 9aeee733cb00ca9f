"""Effects of the user's own: a function of channels, beside the effects of the catalogue."""

from flexspline.own.effect import Design, OwnEffect, design_of, own_effect

__all__ = ["Design", "OwnEffect", "design_of", "own_effect"]
