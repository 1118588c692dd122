"""The claims of the paper, each with its verdict, its evidence and the command that makes our number.

Places are those of Riddle et al. 2023, "A Dynamic Simulation of a Compliant Worm Robot Amenable to Neural Control".
"""

from annelid.studies.claims.actuation import actuation_claims
from annelid.studies.claims.control import control_claims
from annelid.studies.claims.discussion import discussion_claims
from annelid.studies.claims.evidence import MAIN, Evidence, claim_cases
from annelid.studies.claims.outlook import outlook_claims
from annelid.studies.claims.results import result_claims
from annelid.studies.claims.structure import structure_claims
from annelid.studies.contents import Claim

__all__ = ["Evidence", "claim_cases", "paper_claims"]


def paper_claims(evidence: Evidence) -> list[Claim]:
    """Judges every claim, in the order of the paper."""
    main = evidence.store.run(MAIN)
    outcome = evidence.results[MAIN]
    return [
        *structure_claims(evidence, main),
        *actuation_claims(evidence, outcome, main),
        *control_claims(evidence, outcome, main),
        *result_claims(evidence, outcome, main),
        *discussion_claims(evidence, outcome, main),
        *outlook_claims(evidence),
    ]
