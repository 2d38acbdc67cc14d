"""What is written whole or not at all, and read back: the folders of a run, a comparison, laps and a map.

whole, writing, exchange    a folder that takes the place of an older one when all of it is written
told, recorded_arrays       what a folder's JSON and arrays must be to be read back
run, comparison, laps, map    a file a kind of folder: its marker, its files, how they are written and read
"""
