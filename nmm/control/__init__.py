"""From robot, tasks, limits and objective to u: functions, resolvers, steps, and controllers that users call.

Nothing here integrates, records or judges.
"""
