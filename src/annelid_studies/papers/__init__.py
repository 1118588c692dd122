"""What the examinations of published papers share: verdicts on claims, the words of them, and the report."""
