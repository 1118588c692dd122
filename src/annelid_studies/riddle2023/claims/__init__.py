"""The claims of the paper, each with its verdict, its evidence and the command that makes our number."""

from annelid_studies.papers.report_parts import Claim
from annelid_studies.papers.words import texts
from annelid_studies.riddle2023.claims import discussion as discussion
from annelid_studies.riddle2023.claims import future as future
from annelid_studies.riddle2023.claims import model as model
from annelid_studies.riddle2023.claims import results as results
from annelid_studies.riddle2023.claims.evidence import CLAIMS_TOML, Evidence, claim_cases, judge, rule

__all__ = ["Evidence", "claim_cases", "judge", "paper_claims", "rule"]


def paper_claims(evidence: Evidence) -> list[Claim]:
    """Judges every claim, in the order of the paper."""
    return [judge(name, evidence) for name in texts(CLAIMS_TOML)["claims"]]
