"""Order analysis: what turns with the joint, found in its runs and named."""

from flexspline.orders.analysis import FoundOrder, OrderAnalysis, find_orders
from flexspline.orders.parts import Pair, pairs
from flexspline.orders.spectrum import OrderSpectrum, TimeSpectrum, order_spectrum, time_spectrum
from flexspline.orders.vibrations import Vibration

__all__ = [
    "FoundOrder",
    "OrderAnalysis",
    "OrderSpectrum",
    "Pair",
    "TimeSpectrum",
    "Vibration",
    "find_orders",
    "order_spectrum",
    "pairs",
    "time_spectrum",
]
