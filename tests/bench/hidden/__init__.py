"""Frozen cases in which effects are hidden, made by numpy and scipy alone.

Nobody tunes anything on these seeds and forms. A change here starts a new benchmark.
"""
