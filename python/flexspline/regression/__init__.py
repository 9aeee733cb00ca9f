"""Least squares on filtered rows: columns, Gram matrices, and models that are looked for."""
