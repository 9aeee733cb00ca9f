"""The three papers, done again on simulated rigs, with each published claim beside ours."""
