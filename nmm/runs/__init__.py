"""The loop closed: integrated, judged and recorded."""
