"""Which run to record next, computed: the excitation that best separates what is confounded.

`plan` has what a rig may do, and the answer; `recording` the runs that labs record, each as a log
that the core reads, `information` what it would tell, `planning` the search. What a discovery or a
fit left open is asked for by `asking.py`.
"""
