"""Numbers of fits, discoveries, estimates, exports and certificates, to see that they stay."""
