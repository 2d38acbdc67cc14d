"""The loop closed: integrated, disturbed, recorded, judged.

Nothing here reads a scenario file or draws.
"""
