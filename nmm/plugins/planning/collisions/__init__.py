"""Whether whole motions keep their distances."""
