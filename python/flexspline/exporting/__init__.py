"""A model as a C++ header, as the bytes that replace a header's numbers, or as JSON."""

from flexspline.exporting.exporting import FORMATS, export, export_warnings, namespace_of

__all__ = ["FORMATS", "export", "export_warnings", "namespace_of"]
