"""What was found out with annelid: studies, each a design, its numbers, its pictures and its text."""
