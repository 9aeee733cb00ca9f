"""Naming what a model of a joint lacks."""
