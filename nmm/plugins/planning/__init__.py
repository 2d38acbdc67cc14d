"""Plans: motions from a start to a goal that keep distances and limits, searched, shortened and timed."""
