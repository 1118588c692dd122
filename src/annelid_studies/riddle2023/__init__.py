"""The paper, reproduced: its figures, its claims, and examinations of it."""
