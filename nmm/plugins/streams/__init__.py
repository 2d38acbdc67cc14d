"""Streams: what a robot does, shown live by Rerun and Foxglove, or recorded for them."""
