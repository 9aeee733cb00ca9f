"""Which run to record next, computed: the excitation that best separates what is confounded.

`limits` what a rig may do, `motion` and `family` the runs that labs record, `setting` load and
temperature, `recording` a run as a log that the core reads, `information` what it would tell,
`search` the best of all, `planning` the call, `plan` and `says` its answer. What a discovery or a
fit left open is asked for by `discovery/experimenting.py`.
"""
