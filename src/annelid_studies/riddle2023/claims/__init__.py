"""The claims of the paper, each with its verdict, its evidence and the command that makes our number.

Places are those of Riddle et al. 2023, "A Dynamic Simulation of a Compliant Worm Robot Amenable to Neural Control".
"""

from annelid_studies.riddle2023.claims.discussion import discussion_claims, outlook_claims, result_claims
from annelid_studies.riddle2023.claims.evidence import Evidence, claim_cases, rule
from annelid_studies.riddle2023.claims.model import actuation_claims, control_claims, structure_claims
from annelid_studies.riddle2023.contents import Claim

__all__ = ["Evidence", "claim_cases", "paper_claims", "rule"]


def paper_claims(evidence: Evidence) -> list[Claim]:
    """Judges every claim, in the order of the paper."""
    topics = structure_claims, actuation_claims, control_claims, result_claims, discussion_claims, outlook_claims
    return [claim for judge in topics for claim in judge(evidence)]
