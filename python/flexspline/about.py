"""What is installed: the version, and where the core's headers are."""

from __future__ import annotations

from pathlib import Path

__all__ = ["PACKAGE", "__version__", "get_include"]

__version__ = "0.1.0"

PACKAGE = Path(__file__).parent
"""The folder of the package."""


def get_include() -> str:
    """Return the folder of the core's C++ headers, for a compiler's -I."""
    return str(PACKAGE / "include")
