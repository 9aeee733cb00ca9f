"""Fits to the motion itself: the parameters whose forward simulation misses it least."""
