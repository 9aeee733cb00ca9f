"""The three papers, done again on simulated rigs, with each published claim beside ours."""

from flexspline.reproduce.claims import (
    PAPERS,
    Claim,
    Reproduction,
    Story,
    Verdict,
    claims_of,
    reproduce,
)

__all__ = ["PAPERS", "Claim", "Reproduction", "Story", "Verdict", "claims_of", "reproduce"]
