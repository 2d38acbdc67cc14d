"""The loop closed: integrated, judged, recorded, written."""
