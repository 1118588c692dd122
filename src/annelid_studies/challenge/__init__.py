"""A benchmark of soft peristaltic locomotion: frozen tasks, entrants, scores with intervals, and a ranking."""
