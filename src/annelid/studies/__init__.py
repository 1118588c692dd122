"""The paper, reproduced and examined: cases, examinations, claims and the report."""
