"""What a run amounts to: its outcome, why, and what is worth a warning, all as findings."""
